"""What one visitor has on the desk: the robot, its history, and the posture it stands in."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field, replace

from mbs.app.desk.document.document import Document
from mbs.app.desk.document.tables import Tables
from mbs.app.desk.session_posture import Vector
from mbs.assembly import System
from mbs.errors import DescriptionError, MbsError

_LONGEST_HISTORY = 200


@dataclass(slots=True)
class Session:
    """The state of one browser tab, in the memory of the server only.

    Attributes:
        document: as typed last, perhaps with mistakes.
        good: the last document that could be assembled.
        system: of `good`; None until the first is assembled.
        tables: what of `good` is shown in the grids.
        q: (nq,) present posture of `system` [rad or m].
        refusal: why `document` could not be assembled, "" if it could.
        past: documents before the present one, the oldest first.
        future: documents that were undone, the next one last.
        shown: roles of the picture that were switched, by name.
        notes: what panels keep for a reload, by names of their own.
    """

    document: Document
    good: Document | None = None
    system: System | None = None
    tables: Tables | None = None
    q: Vector = ()
    refusal: str = ""
    past: list[Document] = field(default_factory=list)
    future: list[Document] = field(default_factory=list)
    shown: dict[str, bool] = field(default_factory=dict)
    notes: dict[str, object] = field(default_factory=dict)

    def doubled(self) -> Session:
        """The same in another tab: what is changed there stays as it is here."""
        return replace(
            self,
            past=list(self.past),
            future=list(self.future),
            shown=dict(self.shown),
            notes=deepcopy(self.notes),
        )

    def change(self, document: Document) -> None:
        """Put another document in the place of the present one, which can be had back."""
        if document == self.document:
            return
        self.past.append(self.document)
        del self.past[:-_LONGEST_HISTORY]
        self.future.clear()
        self.document = document

    def undo(self) -> bool:
        """Take back the last change; whether there was one."""
        if not self.past:
            return False
        self.future.append(self.document)
        self.document = self.past.pop()
        return True

    def redo(self) -> bool:
        """Make the last change that was taken back again; whether there was one."""
        if not self.future:
            return False
        self.past.append(self.document)
        self.document = self.future.pop()
        return True

    def settle(self, document: Document, q: Vector) -> None:
        """Take a document that was assembled as the one that is shown, in the posture q (nq,)."""
        self.good, self.system, self.tables = document, document.system(), document.shown()
        self.q, self.refusal = q, ""

    @property
    def shown_tables(self) -> Tables:
        """What the grids show: the cells as typed, or the links of a composed mechanism."""
        known = self.tables is not None and self.document == self.good
        return self.tables if known and self.tables is not None else self.document.tables

    def require_system(self) -> System:
        """The system of the document as typed.

        Raises:
            MbsError: a cell is wrong, or the mechanism cannot be assembled; the sentence says why.
        """
        if self.document == self.good and self.system is not None:
            return self.system
        for problem in self.document.problems:
            raise DescriptionError(problem.sentence)
        raise MbsError(self.refusal or f"{self.document.name}: it is still being assembled")
