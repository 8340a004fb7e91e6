"""``python -m spindle_fem``: the command line without an installed script."""

from spindle_fem.cli import main

if __name__ == "__main__":
    main()
