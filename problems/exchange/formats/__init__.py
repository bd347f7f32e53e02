"""Reading of contact problems from files of other programs and from plain arrays."""
