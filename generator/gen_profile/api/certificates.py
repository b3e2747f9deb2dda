"""A proof for all machines of a spec, made and checked again."""

from pathlib import Path

from gen_profile.assurance.certificate.certify import Progress
from gen_profile.assurance.certificate.document import Certificate
from gen_profile.assurance.certificate.from_file import certify_artefact as _certify_artefact
from gen_profile.assurance.certificate.from_file import check_certificate as _check_certificate
from gen_profile.spec.arguments import as_path
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.support.progress import require_progress


def certify_artefact(
    path: Path | str, spec: Spec | Path | str | None = None, *, progress: Progress = lambda _, __: None
) -> Certificate:
    """Prove that no machine of a spec's ranges sways more than a bound after a file's motion.

    docs/certificate.md states what is proved. A certificate is written beside the file where every limit is
    proved to be kept: its name with ``.certificate.json``.

    Parameters
    ----------
    path : Path or str
        Any artefact of a motion.
    spec : Spec, or the path of one, optional
        Taken from ``manifest.json`` beside the file when not given.
    progress : callable
        Told how many boxes of machines are done, and of how many so far.

    Returns
    -------
    Certificate
        Of what could be proved; `Certificate.proved` tells whether that is all.

    Raises
    ------
    CertificateError
        No proof is written for this machine, or what the spec asks; or setpoints break limits of the axes.
    OutputError, ExportError, SpecError, CosimulationError
        As of `gen_profile.check_artefact`.

    Examples
    --------
    >>> gp.certify_artefact("deploy/paper.csv").proved  # what gp.design wrote
    True
    """
    require_progress(progress)
    return _certify_artefact(as_path(path), None if spec is None else as_spec(spec), progress=progress)


def check_certificate(
    path: Path | str,
    certificate: Path | str,
    spec: Spec | Path | str | None = None,
    *,
    progress: Progress = lambda _, __: None,
) -> Certificate:
    """Prove again what a certificate says of a file, with nothing solved and nothing believed of it.

    Parameters
    ----------
    path : Path or str
        The artefact.
    certificate : Path or str
    spec : Spec, or the path of one, optional
        Taken from ``manifest.json`` beside the file when not given.
    progress : callable
        Told how many boxes of machines are done, and of how many.

    Raises
    ------
    CertificateError
        It is damaged, is about something else, or proves less than it says.
    OutputError, ExportError, SpecError
        As of `gen_profile.check_artefact`.

    Examples
    --------
    >>> _ = gp.certify_artefact("deploy/paper.csv")
    >>> gp.check_certificate("deploy/paper.csv", "deploy/paper.csv.certificate.json").proved
    True
    """
    require_progress(progress)
    given = None if spec is None else as_spec(spec)
    return _check_certificate(as_path(path), as_path(certificate), given, progress=progress)
