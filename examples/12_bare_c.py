"""A four-bar as C for a microcontroller: a loop at 1 kHz without heap, in single precision.

Run it with `python examples/12_bare_c.py [folder]`; the code goes to `build/bare_c` if no folder is
named. The loop runs on this computer here, and needs its C compiler.
"""

# %% The mechanism's motion as C
import subprocess
import sys
from pathlib import Path

import numpy as np

import mbs

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bare_c")
system = mbs.load("four_bar").assemble()
library = mbs.export.c_library(system, folder / "crank", target="bare", real="float")
print(f"C library: {', '.join(sorted(path.name for path in library.iterdir()))}")

# %% The loop: the law gives a torque, and the mechanism moves on by 1 ms
(library / "loop.c").write_text("""
#include <stdio.h>
#include "crank.h"

static four_bar_state s;  /* all memory there is */
static crank_real w[FOUR_BAR_STEP_SZ_W];

int main(void) {
    crank_real q[3], v[3], a[3], u[1] = {0.0f};
    int k, status = four_bar_start(&s, NULL, NULL, NULL, w);
    for (k = 0; k < 1000 && !status; ++k) {
        status = four_bar_motion(&s, u, q, v, a, w);
        u[0] = 20.0f - 4.0f * v[0] - 40.0f * (q[0] - 1.0f);
        if (!status) status = four_bar_step(&s, u, 0.001f, w);
    }
    printf("%d %.9g %.9g\\n", status, (double)s.x[0], (double)s.x[1]);
    return status;
}
""")

# %% Run here; arm-none-eabi-gcc -std=c99 -ffreestanding -mcpu=cortex-m7 -c compiles the same files
try:
    compiler = mbs.native.find_compiler()
except mbs.errors.CompilerError as error:
    sys.exit(f"The loop is left out: {error}")
sources = [str(library / name) for name in ("crank.c", "four_bar_step.c", "loop.c")]
program = library / "loop"
flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion"]
subprocess.run([*compiler.command, *flags, *sources, "-o", str(program), "-lm"], check=True)
answer = subprocess.run([str(program.resolve())], check=True, capture_output=True, text=True)
status, q_end, v_end = (float(text) for text in answer.stdout.split())
print(f"Status {status:.0f}; after 1 s the crank stands at {q_end:.6f} rad, {v_end:.6f} rad/s")


# %% The same law in continuous time and double precision
def law(t, q, v):
    """Efforts of all joints."""
    return np.array([20.0 - 4.0 * v[0] - 40.0 * (q[0] - 1.0), 0.0, 0.0])


motion = mbs.simulate.run(system, duration=1.0, tau=law)
print(f"Difference from continuous control: {abs(motion['j1.q'][-1] - q_end):.1e} rad")
