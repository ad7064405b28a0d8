"""The program: `scatterproof`, or `python -m scatterproof`."""

import signal
import sys

from . import _core


def main() -> None:
    # The program listens for signals itself where it has work to keep; elsewhere Ctrl-C ends it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_core.main(["scatterproof", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
