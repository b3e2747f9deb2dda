"""Deployment by OPC UA, as a user does it, to simulated controllers and to servers that are odd."""

import base64
import hashlib
import json
import re
import signal
import threading
import time
from contextlib import ExitStack, closing, contextmanager
from datetime import UTC, datetime, timedelta

import pytest
from asyncua import Server, ua
from command_line import error_of, run_here
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from end_to_end.simulated_controllers import BARE, free_port, in_thread, serving

from gen_profile.delivery.deployment.certificates import fingerprint, own_certificate
from gen_profile.delivery.deployment.deploy import deploy
from gen_profile.delivery.deployment.mailbox import Mailbox
from gen_profile.delivery.deployment.opcua import OpcUaAccess, OpcUaLink
from gen_profile.delivery.deployment.plc_sim import PlcSimOptions, SimulatedOpcUaController
from gen_profile.delivery.deployment.table import read_table
from gen_profile.delivery.deployment.watching.judge import Judge
from gen_profile.support.errors import DeploymentError, OutputError

pytestmark = pytest.mark.slow

FORMS = ("--export", "plc", "--export", "twincat")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Two exported moves, and certificates of both sides."""
    folder = tmp_path_factory.mktemp("deployed")
    for name, distance in {"old": 0.3, "new": 0.25}.items():
        outcome = run_here(*BARE, *FORMS, "--set", f"move.distance={distance}", "--out", folder / name)
        assert outcome.code == 0, outcome.err
    for name in ("plc", "me"):
        own_certificate(folder / f"{name}.pem")
    return folder


@contextmanager
def controller(files, **options):
    port = free_port()
    secure = {} if options.get("secure") is False else {"certificate": files / "plc.pem"}

    table, options = read_table(files / "old" / "paper.st"), PlcSimOptions(port=port, **secure, **options)
    with serving(SimulatedOpcUaController(table, options)) as address:
        yield address


@pytest.fixture(scope="module")
def plc(files):
    with controller(files) as url:
        yield url


@pytest.fixture(scope="module")
def access(files, plc):
    shown = fingerprint(own_certificate(files / "plc.pem").der)
    return ("--to", plc, "--certificate", files / "me.pem", "--fingerprint", shown)


def recorded(folder):
    return json.loads((folder / "deployments.json").read_text("utf-8"))["deployments"]


def test_a_table_gets_into_a_controller_and_back(files, access):
    new, old = files / "new" / "paper.st", files / "old" / "FB_paper.TcPOU"
    assert run_here("deploy", old, *access, "--verify").code == 0
    done = run_here("deploy", new, *access, "--by", "E. Ngineer", "--json")
    assert done.code == 0, done.err
    document = done.document
    assert (document["action"], document["by"], document["check"]["passed"]) == (
        "deployed",
        "E. Ngineer",
        True,
    )
    assert document["controller"]["policy"] == "Aes256Sha256RsaPss"
    assert document["controller"]["instance"] == "FB_paper"
    assert document["held_sha256"] == document["table_sha256"]
    verified = run_here("deploy", new, *access, "--verify", "--json")
    assert (
        verified.document["record"]
        == document
        == json.loads((new.parent / "deployments.json").read_text())["deployments"][0]
    )
    assert "does not use" in error_of("deploy", old, *access, "--verify", code=4)
    assert "rolled back" in run_here("deploy", old, *access, "--rollback").out
    assert "in use already" in run_here("deploy", old, *access).out
    assert [one["action"] for one in recorded(old.parent)] == ["rolled back", "in use already"]


def test_the_record_is_signed(files, access, tmp_path):
    key = Ed25519PrivateKey.generate()
    secret = b"Ed\0\0B2" + bytes(48) + b"12345678" + key.private_bytes_raw() + bytes(64)
    (tmp_path / "bay.key").write_text(f"untrusted comment: a key\n{base64.b64encode(secret).decode()}\n")
    done = run_here("deploy", files / "old" / "paper.st", *access, "--sign", tmp_path / "bay.key")
    assert done.code == 0 and "deployments.json.minisig" in done.err
    record = (files / "old" / "deployments.json").read_bytes()
    lines = (files / "old" / "deployments.json.minisig").read_text("utf-8").splitlines()
    assert "deployments of paper, the latest at " in lines[2]
    key.public_key().verify(base64.b64decode(lines[1])[10:], hashlib.blake2b(record).digest())


def test_a_record_that_cannot_be_written_does_not_hide_what_was_done(files, access, monkeypatch):
    def full(*_):
        raise OutputError("Cannot write: no space left.")

    monkeypatch.setattr("gen_profile.delivery.deployment.record.deliver", full)
    done = run_here("deploy", files / "old" / "paper.st", *access)
    assert (done.code, done.errors[-2]) == (2, "Error: Cannot write: no space left.")
    assert done.errors[-1].startswith("Error: The controller uses ")


def test_the_controller_plays_what_was_deployed(files, plc, access):
    assert run_here("deploy", files / "new" / "paper.st", *access).code == 0
    table = read_table(files / "new" / "paper.st")
    own = files / "me.pem"
    with closing(OpcUaLink(OpcUaAccess(url=plc, certificate=own, fingerprint=access[-1]))) as link:
        runner, client = link._runner, link._client
        instance = runner.run(client.nodes.objects.get_child([f"{2}:FB_paper"]))
        execute = runner.run(instance.get_child("2:bExecute"))
        runner.run(execute.write_value(True))
        with pytest.raises(DeploymentError, match="moves"):
            (box := Mailbox(link)).switch(read_table(files / "old" / "paper.st").checksum)
        box.release()
        done = runner.run(instance.get_child("2:bDone"))
        while not runner.run(done.read_value()):
            time.sleep(0.05)
        position = runner.run(instance.get_child("2:fPosition"))
        assert runner.run(position.read_value()) == table.motions[0].target == 0.25
        runner.run(execute.write_value(False))


@pytest.fixture
def fresh(files):
    """A controller that was just started, any program let in."""
    with controller(files, secure=False) as url:
        yield url


def test_what_stands_is_watched(files, fresh, tmp_path):
    old, log, other = files / "old" / "paper.st", tmp_path / "log.csv", tmp_path / "other.csv"
    other.write_text("mine", "utf-8")
    log.symlink_to(other)  # as another user may have laid it in a folder that both write to
    where = ("--to", fresh, "--security", "none")
    done = run_here("deploy", old, *where, "--watch", "--for", "1", "--log", log, "--json")
    assert done.code == 0, done.err
    assert other.read_text("utf-8") == "mine"
    document = done.document
    assert (document["action"], document["fault"], document["moving"]) == ("watched", None, 0)
    assert 1 < document["states"] <= document["cycles"] + 1
    head, first, *_ = log.read_text("utf-8").splitlines()
    assert head.startswith("time_s,call,phase,error,off_nominal,place_cycles,rate,cart_position_m,")
    assert re.fullmatch(r"0\.\d{3},\d+,idle,0,0,0\.0,0\.0,0\.0,0\.0,0\.0,began 20\S+\+00:00", first)
    assert len({len(line.split(",")) for line in log.read_text("utf-8").splitlines()}) == 1
    assert "does not use" in error_of("deploy", files / "new" / "paper.st", *where, "--watch", code=4)


@pytest.fixture
def once_watched(monkeypatch):
    """Give what does something in another thread once a watch has begun."""
    begun, take = threading.Event(), Judge.take
    monkeypatch.setattr(Judge, "take", lambda *arguments: begun.set() or take(*arguments))

    @contextmanager
    def later(action, *arguments):
        begun.clear()
        thread = threading.Thread(target=lambda: begun.wait(30) and action(*arguments))
        thread.start()
        yield
        thread.join()

    return later


def test_a_motion_is_watched_and_another_deployment_ends_it(
    files, fresh, tmp_path, once_watched, monkeypatch
):
    old, new, log = files / "old" / "paper.st", read_table(files / "new" / "paper.st"), tmp_path / "log.csv"
    where, own = ("--to", fresh, "--security", "none"), OpcUaAccess(url=fresh, security="none")

    def execute(value):
        with closing(OpcUaLink(own)) as link:
            runner, client = link._runner, link._client
            node = runner.run(client.nodes.objects.get_child(["2:FB_paper", "2:bExecute"]))
            runner.run(node.write_value(value))

    take = Judge.take

    def interrupted_on_arrival(judge, *arguments):
        said = take(judge, *arguments)
        if judge.seen.completed:
            signal.raise_signal(signal.SIGINT)
        return said

    with once_watched(execute, True), monkeypatch.context() as patched:
        patched.setattr(Judge, "take", interrupted_on_arrival)
        done = run_here("deploy", old, *where, "--watch", "--log", log)
    assert done.code == 0 and "a motion's setpoints, all the table's bit for bit" in done.out, done.err
    assert "motions begun: 1, arrived: 1." in done.out and "motion 1 begins" in done.err
    rows = [line.split(",") for line in log.read_text("utf-8").splitlines()]
    moving = {float(row[5]): float(row[7]) for row in rows if row[2] == "moving"}
    played = read_table(old).motions[0].played.position[:, 0]
    assert len(moving) > 20 and all(played[int(place)] == at for place, at in moving.items())
    execute(False)

    def rival():
        with closing(OpcUaLink(own)) as link:
            deploy(new, Mailbox(link))

    with once_watched(rival):
        found = run_here("deploy", old, *where, "--watch", "--json")
    assert found.code == 4 and "has switched to its other buffer" in found.document["fault"]
    assert f"Error: {found.document['fault']}" in found.err


def test_a_server_that_does_not_show_the_state_is_told(files, fresh, monkeypatch):
    monkeypatch.setattr("gen_profile.delivery.deployment.opcua.STATE", "aNothing")
    where = ("--to", fresh, "--security", "none", "--watch")
    assert "FB_paper shows no aNothing: let the server show it" in error_of(
        "deploy", files / "old" / "paper.st", *where, code=6
    )


def test_a_controller_that_is_switched_off_ends_the_watch(files, monkeypatch, once_watched):
    monkeypatch.setattr("gen_profile.delivery.deployment.watching.watch.LOST_FOR", 1.0)
    ending = ExitStack()
    url = ending.enter_context(controller(files, secure=False))
    where = ("--to", url, "--security", "none")
    with once_watched(ending.close):
        found = run_here("deploy", files / "old" / "paper.st", *where, "--watch")
    assert found.code == 6 and "could not be taken up again" in found.err, found.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--verify", "--watch"), "--watch begins with that"),
        (("--watch", "--rollback"), "change and record nothing"),
        (("--for", "3"), "are for --watch"),
        (("--watch", "--log", "none/log.csv"), "there is no folder none"),
    ],
)
def test_options_that_do_not_go_together_are_refused(options, words, files, access):
    assert words in error_of("deploy", files / "old" / "paper.st", *access, *options)


@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ({"--certificate": None}, 2, "--certificate: name the PEM file"),
        ({"--fingerprint": None}, 6, "is not known here yet: its SHA-256 is"),
        ({"--fingerprint": "AA:BB"}, 6, "is another one than was named"),
        ({"--security": "sign"}, 6, "offers no sign .*, only SignAndEncrypt"),
        ({"--user": "me"}, 6, "The server refuses: "),
        ({"--to": "opc.tcp://127.0.0.1:9"}, 6, "cannot be reached"),
        ({"--to": "ads://1"}, 2, "is no address such as"),
        ({"--to": "opc.tcp://127.0.0.1"}, 2, "is no address such as"),
        ({"--to": "opc.tcp://me:secret@127.0.0.1:9"}, 2, "is no address such as"),
        ({"--instance": "Main/FB_2"}, 6, r"none that ends in Main/FB_2 \(FB_paper\)"),
        ({"--certificate": "manifest.json"}, 2, "is no PEM file of a certificate"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_what_is_not_as_it_should_be_is_told_in_a_sentence(changes, code, words, files, access, monkeypatch):
    monkeypatch.setenv("GEN_PROFILE_PASSWORD", "wrong")
    monkeypatch.chdir(files / "old")
    options = dict(zip(access[::2], access[1::2], strict=True)) | changes
    given = [word for option, value in options.items() if value is not None for word in (option, value)]
    found = run_here("deploy", "paper.st", *given)
    assert found.code == code, found.err
    assert re.search(words, found.err), found.err


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("manifest.json", "the suffixes of those that do are"),
        ("absent.st", "absent.st"),
    ],
)
@pytest.mark.parametrize("options", [(), ("--verify",), ("--watch",)])
def test_a_file_that_cannot_be_deployed_is_named_before_the_access(file, words, options, files):
    """A certificate was asked for first, and made, for nothing."""
    found = run_here("deploy", files / "old" / file, "--to", "opc.tcp://127.0.0.1:9", *options)
    assert found.code == 2 and words in found.err and "--certificate" not in found.err, found.err


def test_a_wrapper_has_no_table(files, access):
    assert "is a wrapper; name the file of the playback block" in error_of(
        "deploy", files / "old" / "FB_paper_Axis.TcPOU", *access, code=5
    )


@pytest.fixture(scope="module")
def odd():
    """A server with arrays that no block answers, each odd in its own way, and no security."""
    port = free_port()

    async def main(ready, end):
        server = Server()
        await server.init()
        server.set_endpoint(f"opc.tcp://127.0.0.1:{port}")
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        whole = ua.Variant([0.0] * 256, ua.VariantType.Double)
        for name, value in {
            "silent": whole,
            "rounding": ua.Variant([0.0] * 256, ua.VariantType.Float),
            "short": ua.Variant([0.0] * 10, ua.VariantType.Double),
            "scalar": ua.Variant(0.0, ua.VariantType.Double),
            "locked": whole,
        }.items():
            folder = await server.nodes.objects.add_folder(1, f"in {name}")
            instance = await folder.add_object(1, name)
            request = await instance.add_variable(1, "aRequest", value)
            await request.set_writable(name != "locked")
            await instance.add_variable(1, "aReply", value)
        async with server:
            ready()
            await end.wait()

    with in_thread(main):
        yield f"opc.tcp://127.0.0.1:{port}"


@pytest.mark.parametrize(
    ("instance", "words"),
    [
        ("", r"shows several \(in silent/silent, .*; name one as the instance"),
        ("silent", "The block does not answer, as if it were not called"),
        ("in rounding/rounding", "aRequest is array of Float there, not an array of Double"),
        ("short", "aRequest has 10 values there in place of 256"),
        ("scalar", "aRequest is value of Double there"),
        ("locked", "The server refuses: "),
    ],
)
def test_odd_servers_are_told_apart(instance, words, files, odd, monkeypatch):
    monkeypatch.setattr("gen_profile.delivery.deployment.mailbox.LOOKS", 2)
    where = ("--to", odd, "--security", "none", "--instance", instance)
    found = run_here("deploy", files / "old" / "paper.st", *where)
    assert found.code == 6 and re.search(words, found.err), found.err


def test_a_server_without_a_block_is_told(files, monkeypatch, odd):
    monkeypatch.setattr("gen_profile.delivery.deployment.opcua.REPLY", "aNothing")
    assert "shows no block with aRequest" in error_of(
        "deploy", files / "old" / "paper.st", "--to", odd, "--security", "none", code=6
    )


def test_broken_connections_are_taken_up(files, plc, access, monkeypatch):
    table = read_table(files / "new" / "paper.st")
    with closing(
        OpcUaLink(OpcUaAccess(url=plc, certificate=files / "me.pem", fingerprint=access[-1]))
    ) as link:
        write, cut = link.write, iter([False, True, False, True, True])

        def writing(request):
            if next(cut, False):
                link._client.uaclient.disconnect_socket()
            write(request)

        monkeypatch.setattr(link, "write", writing)
        box = Mailbox(link)
        box.write(table.values)
        box.release()
        assert (box.read(1, len(table.values)) == table.values).all()


def expired(path):
    """Let a certificate end yesterday."""
    own = own_certificate(path)
    key = serialization.load_pem_private_key(own.key, None)
    now = datetime.now(UTC)
    names = own.certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    builder = x509.CertificateBuilder(own.certificate.subject, own.certificate.subject, key.public_key(), 7)
    builder = builder.not_valid_before(now - timedelta(9)).not_valid_after(now - timedelta(1))
    made = builder.add_extension(names, critical=False).sign(key, hashes.SHA256())
    path.write_bytes(made.public_bytes(serialization.Encoding.PEM) + own.key)


def test_expired_certificates_are_refused(files, plc, access, tmp_path, monkeypatch):
    expired(tmp_path / "me.pem")
    options = dict(zip(access[::2], access[1::2], strict=True)) | {"--certificate": tmp_path / "me.pem"}
    assert "me.pem is good from" in error_of(
        "deploy", files / "old" / "paper.st", *(word for pair in options.items() for word in pair), code=6
    )
    tomorrow = datetime.now(UTC) + timedelta(days=365 * 6)
    monkeypatch.setattr(
        "gen_profile.delivery.deployment.certificates.datetime",
        type("Later", (), {"now": lambda _: tomorrow}),
    )
    assert f"The certificate of {plc} is good from" in error_of(
        "deploy", files / "old" / "paper.st", *access, code=6
    )
