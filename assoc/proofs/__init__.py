"""Proofs that anyone can check: written here, replayed in exact arithmetic by ``assoc/check.py``."""

from assoc.proofs.write import write_proof

__all__ = ["write_proof"]
