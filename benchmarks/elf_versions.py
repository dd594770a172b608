"""Which versions of the C library an ELF file asks for."""

import re


def glibc_versions(library):
    """Versions (major, minor) of the symbols that a library takes from glibc.

    Their names stand in its table of strings, where the loader looks them up.
    """
    if library[:4] != b"\x7fELF":
        raise ValueError("not an ELF file")
    found = re.findall(rb"\0GLIBC_(\d+)\.(\d+)[.\d]*(?=\0)", library)
    return {(int(major), int(minor)) for major, minor in found}
