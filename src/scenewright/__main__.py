"""`python -m scenewright`: the same as the command."""

import sys

from scenewright.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
