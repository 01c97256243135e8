"""The command `gslts` as `python -m gslts`."""

from gslts.cli import main

if __name__ == "__main__":
    main()
