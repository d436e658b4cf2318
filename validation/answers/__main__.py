"""Write or check the book of answers, see `book`."""

import sys

from validation.answers.book import main

if __name__ == "__main__":
    sys.exit(main())
