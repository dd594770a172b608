"""`python -m mbs` is the command `mbs`."""

from mbs.app.cli import main

if __name__ == "__main__":
    main()
