"""``python -m scara_ident`` is the command ``scara-ident``."""

from scara_ident.cli import main

if __name__ == "__main__":
    main()
