"""How kernels become LLVM's code: as numba does it, but arrays that a kernel is given are not counted and not unpacked.

Records of dozens of arrays are passed from kernel to kernel. numba takes such a record apart at each call, one
instruction for each number that describes an array, and counts a reference to each array wherever a variable holds it;
that was two thirds of the code to compile. What a kernel is given lives until it returns, so variables that hold
nothing else need no counts (`_borrowed`); and the numbers are there already, as arguments of the function (`_Builder`).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Any

from llvmlite.ir import IRBuilder
from llvmlite.ir.instructions import InsertValue
from numba.core import analysis, cgutils, ir, lowering, types

# numba and llvmlite have no type annotations
_IR: Any = ir
_TYPES: Any = types
_ANALYSIS: Any = analysis
_CGUTILS: Any = cgutils
_LOWER: Any = lowering.Lower
_BUILDER: Any = IRBuilder


class _Builder(_BUILDER):  # type: ignore[misc]
    """Takes no part out of a record that the same function has put together: that part is at hand."""

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        path = list(idx) if isinstance(idx, (tuple, list)) else [idx]
        while path and isinstance(agg, InsertValue):
            place = list(agg.indices)
            if path[: len(place)] == place:
                agg, path = agg.value, path[len(place) :]
            elif place[: len(path)] == path:
                # a part of what is asked for was put in last
                break
            else:
                agg = agg.aggregate
        return super().extract_value(agg, path, name) if path else agg


class Lower(_LOWER):  # type: ignore[misc]
    """numba's translation of a kernel, without references to what the kernel is given."""

    def init(self) -> None:
        super().init()
        self._uncounted: set[str] = set()
        if not self.func_ir.func_id.is_generator:
            once = self._assigned_once()
            self._uncounted = self._borrowed(once)
            # no memory is reserved for these: the value is known wherever the variable is used
            self._singly_assigned_vars |= self._uncounted & self._in_order(once)

    def setup_function(self, fndesc: Any) -> None:
        super().setup_function(fndesc)
        self.builder.__class__ = _Builder

    def lower_function_body(self) -> Any:
        last = super().lower_function_body()
        _remove_unused(self.function)
        return last

    def alloca_lltype(self, name: str, lltype: Any, datamodel: Any = None) -> Any:
        if self.context.enable_debuginfo:
            return super().alloca_lltype(name, lltype, datamodel)
        # numba lets LLVM read a module for the size of each variable, which debuggers alone are told
        return _CGUTILS.alloca_once(self.builder, lltype, name=name, zfill=False)

    def incref(self, typ: Any, val: Any) -> None:
        if not self._borrowing:
            super().incref(typ, val)

    _borrowing = False

    def lower_assign(self, ty: Any, inst: Any) -> Any:
        if inst.target.name not in self._uncounted:
            return super().lower_assign(ty, inst)
        value = inst.value
        if isinstance(value, _IR.Expr) and value.op in ("getattr", "static_getitem"):
            record = self.typeof(value.value.name)
            place = record.fields.index(value.attr) if value.op == "getattr" else value.index
            return self.builder.extract_value(self.loadvar(value.value.name), place % len(record))
        self._borrowing = True
        try:
            return super().lower_assign(ty, inst)
        finally:
            self._borrowing = False

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        if name in self._uncounted and name not in self._singly_assigned_vars:
            self._alloca_var(name, self.typeof(name))
            self.builder.store(value, self.getvar(name))
        else:
            super().storevar(value, name, argidx)

    def delvar(self, name: str) -> None:
        if name not in self._uncounted:
            super().delvar(name)

    def _assigned_once(self) -> dict[str, tuple[int, Any]]:
        """The variables with one assignment: the block, and the statement."""
        found: dict[str, Any] = {}
        times: Counter[str] = Counter()
        for offset, block in self.blocks.items():
            for statement in block.find_insts(_IR.Assign):
                found[statement.target.name] = offset, statement
                times[statement.target.name] += 1
        return {name: where for name, where in found.items() if times[name] == 1}

    def _borrowed(self, once: dict[str, tuple[int, Any]]) -> set[str]:
        """The variables that can hold nothing but what the kernel is given, or parts of it."""
        borrowed: set[str] = set()
        waiting = dict(once)
        while True:
            found = {name for name, (_, one) in waiting.items() if self._is_borrowed(name, one.value, borrowed)}
            if not found:
                return borrowed
            borrowed |= found
            waiting = {name: one for name, one in waiting.items() if name not in found}

    def _is_borrowed(self, name: str, value: Any, borrowed: set[str]) -> bool:
        kind = self.typeof(name)
        if isinstance(value, _IR.Arg):
            return bool(self.typeof("arg." + value.name) == kind)
        if isinstance(value, _IR.Var):
            return value.name in borrowed and self.typeof(value.name) == kind
        if not isinstance(value, _IR.Expr):
            return False
        if value.op == "build_tuple":
            kinds = [self.typeof(item.name) for item in value.items]
            return all(item.name in borrowed for item in value.items) and kinds == list(kind)
        if value.op not in ("getattr", "static_getitem", "exhaust_iter") or value.value.name not in borrowed:
            return False
        record = self.typeof(value.value.name)
        if value.op == "getattr":
            return isinstance(record, _TYPES.BaseNamedTuple) and record[record.fields.index(value.attr)] == kind
        if not isinstance(record, _TYPES.BaseTuple):
            return False
        if value.op == "exhaust_iter":
            return bool(record == kind)
        return isinstance(value.index, int) and record[value.index] == kind

    def _in_order(self, once: dict[str, tuple[int, Any]]) -> set[str]:
        """The variables that are assigned before they are used, in whatever order blocks run or are translated."""
        used: defaultdict[str, set[int]] = defaultdict(set)
        for offset, block in self.blocks.items():
            for statement in block.body:
                for name in _names(statement):
                    used[name].add(offset)
        dominators = _ANALYSIS.compute_cfg_from_blocks(self.blocks).dominators()
        return {
            name
            for name, (home, _) in once.items()
            if all(home <= offset and home in dominators[offset] for offset in used[name])
        }


def _names(statement: Any) -> Iterable[str]:
    return (statement.value,) if isinstance(statement, _IR.Del) else (one.name for one in statement.list_vars())


def _remove_unused(function: Any) -> None:
    """Remove what puts together the records that a function is given, where only their parts are used."""
    uses: Counter[int] = Counter()
    for block in function.blocks:
        for one in block.instructions:
            uses.update(map(id, one.operands))
            # phi nodes
            uses.update(id(value) for value, _ in getattr(one, "incomings", ()))
    kept = []
    for one in reversed(function.entry_basic_block.instructions):
        if isinstance(one, InsertValue) and not uses[id(one)]:
            uses.subtract(map(id, one.operands))
        else:
            kept.append(one)
    function.entry_basic_block.instructions[:] = reversed(kept)
