"""``python -m pneudrive`` is the ``pneudrive`` command."""

from pneudrive.cli.main import main

if __name__ == "__main__":
    main()
