"""What a program says on stderr, but for what depends on the cache of kernels."""


def told(stderr: str) -> str:
    """Without the line that announces compiling."""
    return "".join(line for line in stderr.splitlines(keepends=True) if "compiling kernels, once" not in line)
