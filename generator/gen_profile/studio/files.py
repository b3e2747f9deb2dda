"""What a page lets one take away: artefacts that were checked, and the report."""

import io
import queue
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import gettempdir
from threading import Thread

from gen_profile.designs.design import design
from gen_profile.errors import GenProfileError
from gen_profile.private_folder import temporary_folder
from gen_profile.progress import Progress
from gen_profile.report.build import report
from gen_profile.spec.model import Spec
from gen_profile.studio.orders import Order
from gen_profile.studio.workers import Part
from gen_profile.verification.verdict import Check

ZIPPED = (1980, 1, 1, 0, 0, 0)  # no clock in what is delivered


def files(order: Order) -> Iterator[Part]:
    """Run the full check, and give what it passes."""
    parts: queue.Queue[Part | None] = queue.Queue()

    def tell(stage: str, done: int = 0, total: int = 0, remark: str = "") -> None:
        parts.put({"part": "progress", "stage": stage, "done": done, "total": total, "remark": remark})

    def work() -> None:
        try:
            parts.put(_made(order, tell))
        except GenProfileError as error:
            parts.put({"part": "made", "passed": False, "sentences": error.sentences, "file": None})
        except Exception as error:
            sentence = f"Internal error ({type(error).__name__}: {error})."
            parts.put({"part": "made", "passed": False, "sentences": [sentence], "file": None})
        parts.put(None)

    Thread(target=work, daemon=True).start()
    while (part := parts.get()) is not None:
        yield part


def _made(order: Order, tell: Progress) -> Part:
    spec = order.question.spec()
    make: Callable[[Spec, Order, Progress], tuple[Check | None, str, bytes | None]]
    make = _report if order.report else _artefacts
    check, name, content = make(spec, order, tell)
    return {
        "part": "made",
        "passed": check is not None and check.passed,
        "sentences": [] if check is None else [*check.reasons(), *check.warnings()],
        "scenarios": 0 if check is None else len(check.judged),
        "file": None if content is None else (name, content),
    }


def _report(spec: Spec, order: Order, tell: Progress) -> tuple[Check | None, str, bytes | None]:
    made = report(spec, order.formats, progress=tell)
    return made.check, f"{spec.name}.html", made.content


def _artefacts(spec: Spec, order: Order, tell: Progress) -> tuple[Check | None, str, bytes | None]:
    with temporary_folder(Path(gettempdir()), "gen-profile-studio-") as parent:
        folder = parent / "out"
        outcome = design(spec, order.formats, folder, progress=tell)
        return outcome.check, f"{spec.name}.zip", _zipped(folder) if outcome.artefacts else None


def _zipped(folder: Path) -> bytes:
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.iterdir()):
            archive.writestr(zipfile.ZipInfo(path.name, ZIPPED), path.read_bytes(), zipfile.ZIP_DEFLATED)
    return memory.getvalue()
