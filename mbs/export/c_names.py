"""Names that C, C++ and CMake leave free."""

import re
from collections.abc import Iterable, Sequence

from mbs.errors import ModelError


def _words(text: str) -> list[str]:
    return text.split()


_KEYWORDS = _words("""
alignas alignof and and_eq asm auto bitand bitor bool break case catch char class compl const
constexpr continue decltype default delete do double else enum explicit export extern false float
for friend goto if inline int long mutable namespace new noexcept not not_eq nullptr operator or
or_eq private protected public register reinterpret_cast restrict return short signed sizeof static
static_assert struct switch template this thread_local throw true try typedef typeid typename union
unsigned using virtual void volatile wchar_t while xor xor_eq typeof typeof_unqual
const_cast dynamic_cast static_cast concept requires char8_t char16_t char32_t
""")
_REAL_FUNCTIONS = _words("""
acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim
floor fma fmax fmin fmod frexp hypot ilogb ldexp lgamma llrint llround log log10 log1p log2 logb
lrint lround modf nan nearbyint nextafter nexttoward pow remainder remquo rint round scalbln scalbn
sin sinh sqrt tan tanh tgamma trunc j0 j1 jn y0 y1 yn drem significand scalb
exp10 pow10
""")
_FUNCTIONS = _words("""
abort abs atexit atof atoi atol bsearch calloc div exit free getenv labs ldiv llabs malloc mblen
qsort rand realloc srand strtod strtol strtoul system clearerr fclose feof ferror fflush fgetc fgets
fopen fprintf fputc fputs fread freopen fscanf fseek ftell fwrite getc getchar gets perror printf
putc putchar puts remove rename rewind scanf setbuf setvbuf snprintf sprintf sscanf tmpfile tmpnam
ungetc vfprintf vprintf vsnprintf vsprintf memchr memcmp memcpy memmove memset strcat strchr strcmp
strcoll strcpy strcspn strerror strlen strncat strncmp strncpy strpbrk strrchr strspn strstr strtok
clock difftime mktime time asctime ctime gmtime localtime strftime signal raise isnan isinf isfinite
index main gamma isnormal signbit fpclassify finite ffs bcmp bcopy bzero rindex random srandom
casadi_real casadi_int stdin stdout stderr errno linux unix i386 signgam assert
NULL EOF FILE NAN INFINITY HUGE_VAL RAND_MAX BUFSIZ DOMAIN SING OVERFLOW UNDERFLOW
CASADI_CODEGEN_PREFIX CASADI_NAMESPACE_CONCAT CASADI_PREFIX CASADI_SYMBOL_EXPORT
""")
_RESERVED = {
    *_KEYWORDS,
    *_FUNCTIONS,
    *_REAL_FUNCTIONS,
    *(f"{name}{kind}" for name in _REAL_FUNCTIONS for kind in "fl"),
}
_FILES = _words("""
assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign
stdarg stdatomic stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath
threads time uchar wchar wctype strings memory unistd features malloc
example all clean test install help package edit_cache rebuild_cache m c dl rt pthread
""")
_SUFFIXES = _words("""
eval alloc_mem init_mem free_mem checkout release incref decref n_in n_out name_in name_out
default_in sparsity_in sparsity_out work work_bytes check start step motion state watched
""")
_OF_CASADI = ("null", "jac", "hess")


def library_name(folder: str) -> str:
    """The name of files and of the CMake target for a folder of this name."""
    name = re.sub(r"\W", "_", folder, flags=re.ASCII)
    if not re.search(r"[A-Za-z0-9]", name):
        return "models"
    if not name[0].isalpha():
        return f"models_{name.lstrip('_')}"
    return f"{name}_models" if name.lower() in _FILES else name


def check_function_names(names: Sequence[str], where: str) -> None:
    """Refuse names of Functions that no C library can have.

    Args:
        names: of all Functions of a library, different.
        where: which library, for the message.

    Raises:
        ModelError: a name is no identifier, is one of C or C++, or meets another one.
    """
    owner: dict[str, str] = {}
    for name in names:
        if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*_?", name, re.ASCII) or name in _OF_CASADI:
            raise ModelError(
                f"{where}: {name!r} is no name of a function; use letters, digits and single"
                " underscores, a letter first"
            )
        if name in _RESERVED or name.startswith("casadi_"):
            raise ModelError(
                f"{where}: {name!r} is a name of C; give another one, as in"
                f" {{'my_{name}': function}}"
            )
        sizes = (f"{name.upper()}_SZ_W", f"{name.upper()}_STEP_SZ_W")
        for made in (name, *sizes, *(f"{name}_{suffix}" for suffix in _SUFFIXES)):
            if made in owner:
                raise ModelError(
                    f"{where}: functions {owner[made]!r} and {name!r} would both make {made} in C;"
                    " give one of them another name, as in {'name': function}"
                )
            owner[made] = name


def parameter_names(names: Iterable[str], taken: Iterable[str]) -> list[str]:
    """Names of parameters in C, each the given one where it is free.

    What is no letter, digit or underscore of ASCII becomes an underscore.

    Args:
        names: wanted.
        taken: names that mean something else there.
    """
    used = set(taken)
    free = []
    for name in names:
        name = re.sub(r"\W", "_", name, flags=re.ASCII)
        if not name[:1].isalpha():
            name = f"x_{name}"
        while name in used or name in _RESERVED:
            name += "_"
        used.add(name)
        free.append(name)
    return free
