"""What a page lets one take away: artefacts that were checked, and the report."""

import io
import queue
import zipfile
from collections.abc import Iterator
from pathlib import Path
from tempfile import gettempdir
from threading import Thread

from gen_profile.delivery.designs.design import design
from gen_profile.presentation.report.build import report
from gen_profile.presentation.studio.orders import Order
from gen_profile.presentation.studio.workers import Part
from gen_profile.support.errors import GenProfileError
from gen_profile.support.private_folder import temporary_folder
from gen_profile.support.progress import Progress

ZIPPED = (1980, 1, 1, 0, 0, 0)  # no clock in what is delivered


def files(order: Order) -> Iterator[Part]:
    """Run the full check, and give what it passes."""
    parts: queue.Queue[Part | None] = queue.Queue()

    def tell(stage: str, done: int = 0, total: int = 0, remark: str = "") -> None:
        parts.put({"part": "progress", "stage": stage, "done": done, "total": total, "remark": remark})

    def work() -> None:
        try:
            parts.put(_made(order, tell))
        except Exception as error:
            internal = f"Internal error ({type(error).__name__}: {error})."
            sentences = error.sentences if isinstance(error, GenProfileError) else [internal]
            parts.put({"part": "made", "passed": False, "sentences": sentences, "file": None})
        parts.put(None)

    Thread(target=work, daemon=True).start()
    while (part := parts.get()) is not None:
        yield part


def _made(order: Order, tell: Progress) -> Part:
    spec, check, file = order.question.spec(), None, None
    if order.report:
        made = report(spec, order.formats, progress=tell)
        check, file = made.check, (f"{spec.ascii_name}.html", made.content)
    else:
        with temporary_folder(Path(gettempdir()), "gen-profile-studio-") as parent:
            outcome = design(spec, order.formats, parent / "out", progress=tell)
            check = outcome.check
            file = (f"{spec.ascii_name}.zip", _zipped(parent / "out")) if outcome.artefacts else None
    return {
        "part": "made",
        "passed": check is not None and check.passed,
        "sentences": [] if check is None else [*check.reasons(), *check.warnings()],
        "scenarios": 0 if check is None else len(check.judged),
        "file": file,
    }


def _zipped(folder: Path) -> bytes:
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.iterdir()):
            archive.writestr(zipfile.ZipInfo(path.name, ZIPPED), path.read_bytes(), zipfile.ZIP_DEFLATED)
    return memory.getvalue()
