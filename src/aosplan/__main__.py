"""``python -m aosplan``."""

from aosplan.cli.app import main

if __name__ == "__main__":
    main()
