"""Lets ``python -m troupe_training`` run the command line."""

import sys

from troupe_training.cli.main import main

sys.exit(main())
