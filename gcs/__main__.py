"""``python -m gcs``: the same as ``arvi``."""

from gcs.cli import main

if __name__ == "__main__":
    main()
