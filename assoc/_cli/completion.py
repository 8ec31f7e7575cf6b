"""What shells need to complete the names of programs, their options and the values of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from assoc.errors import InvalidInputError

Options = Mapping[str, Sequence[str]]
"""Options of a program, each with the values it takes (none: numbers, files); "" has those of the first word."""

SHELLS = ("bash", "zsh", "fish")


def script(shell: str, programs: Mapping[str, Options]) -> str:
    """Return a script for a shell.

    Raises
    ------
    InvalidInputError
        The shell is not known.
    """
    if shell not in _WRITERS:
        raise InvalidInputError(f"completion: expected one of {', '.join(_WRITERS)}, got {shell!r}")
    return _WRITERS[shell](programs)


def _bash(programs: Mapping[str, Options]) -> str:
    return f"""# for ~/.bashrc: eval "$(assoc completion bash)"
_assoc() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} words=
  if [ "$COMP_CWORD" = 1 ]; then words="{" ".join(programs)}"
  else
    case "${{COMP_WORDS[1]}} $before" in
{_cases(programs, "      {pattern}) words={words!r};;")}
    esac
    if [ -z "$words" ] && [ "${{current#-}}" != "$current" ]; then
      case "${{COMP_WORDS[1]}}" in
{_flags(programs, "        {name}) words={words!r};;")}
      esac
    fi
  fi
  COMPREPLY=($(compgen -W "$words" -- "$current"))
}}
complete -o default -F _assoc assoc
"""


def _zsh(programs: Mapping[str, Options]) -> str:
    return f"""# for ~/.zshrc, after compinit: eval "$(assoc completion zsh)"
_assoc() {{
  if (( CURRENT == 2 )); then compadd -- {" ".join(programs)}; return; fi
  case "$words[2] $words[CURRENT-1]" in
{_cases(programs, "    {pattern}) compadd -- {words}; return;;")}
  esac
  if [[ $PREFIX == -* ]]; then
    case "$words[2]" in
{_flags(programs, "      {name}) compadd -- {words};;")}
    esac
  else _files; fi
}}
compdef _assoc assoc
"""


def _fish(programs: Mapping[str, Options]) -> str:
    lines = [
        "# for ~/.config/fish/config.fish: assoc completion fish | source",
        f"complete -c assoc -n __fish_use_subcommand -f -a '{' '.join(programs)}'",
    ]
    for name, options in programs.items():
        seen = f"complete -c assoc -n '__fish_seen_subcommand_from {name}'"
        for flag, values in options.items():
            start = f"{seen} -l {flag.removeprefix('--')}" if flag else seen
            if not flag or flag.startswith("--"):
                lines.append(f"{start} -x -a '{' '.join(values)}'" if values else start)
    return "\n".join(lines) + "\n"


_WRITERS = dict(zip(SHELLS, (_bash, _zsh, _fish), strict=True))


def _cases(programs: Mapping[str, Options], line: str) -> str:
    """Lines for the options that have values; the first word comes after the name of the program."""
    return "\n".join(
        line.format(pattern=f"'{name} {flag or name}'", words=" ".join(values))
        for name, options in programs.items()
        for flag, values in options.items()
        if values
    )


def _flags(programs: Mapping[str, Options], line: str) -> str:
    flags = {name: " ".join(filter(None, options)) for name, options in programs.items()}
    return "\n".join(line.format(name=name, words=words) for name, words in flags.items())
