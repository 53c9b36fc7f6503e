"""`python -m detpg`."""

from detpg.cli import main

if __name__ == "__main__":
    main()
