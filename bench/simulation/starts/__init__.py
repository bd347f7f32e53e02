"""How the solve of a step starts: from the impulses of the last step, from zero, or from both in turn.

Each is a file with a class; the name of its class is written ``warm``, ``cold`` or ``warm-then-cold``.
"""
