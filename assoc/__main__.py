"""``python -m assoc`` lists the programs."""

from __future__ import annotations

from assoc._cli.program import prepare_streams, run_program

_PROGRAMS = {
    "assoc.simulate": "simulate a scene: python -m assoc.simulate three-radar -o scene.npz",
    "assoc.solve": "associate its measurements: python -m assoc.solve scene.npz --solver aco",
    "assoc.track": "make tracks of scenes or of radar plots: python -m assoc.track scene.npz -o tracks.csv",
    "assoc.register": "find biases of sensors: python -m assoc.register scene.npz -o registered.npz",
    "assoc.sweep": "compare parameters: python -m assoc.sweep scene.npz --solver aco --grid alpha=1,2,3 -o study/",
}


def main() -> int:
    """Print the programs and what each is for."""
    return run_program(_list, "assoc")


def _list() -> None:
    print("assoc: which measurements, from several sensors, came from the same target?")
    print("\nPrograms (each has --help):")
    for name, purpose in _PROGRAMS.items():
        print(f"  python -m {name:<16} {purpose}")


if __name__ == "__main__":
    prepare_streams()
    raise SystemExit(main())
