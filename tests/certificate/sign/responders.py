"""A time stamp server and the revocation lists of a test's authority, over HTTP on this machine."""

from __future__ import annotations

import contextlib
import datetime as dt
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

from asn1crypto import keys, tsp, x509
from cryptography import x509 as certificates
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.x509 import ocsp
from pyhanko.sign.timestamps import DummyTimeStamper
from pyhanko_certvalidator.registry import SimpleCertificateStore

from tests.certificate.sign.authority import SIGNED, Held

Answer = tuple[int, str, bytes]
REPLY = "application/timestamp-reply"


@contextlib.contextmanager
def serving(answers: dict[str, Callable[[bytes], Answer]]) -> Iterator[str]:
    """Answers by path; gives the address of the server."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.do_POST()

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            status, sort, content = answers[self.path](body)
            self.send_response(status)
            self.send_header("Content-Type", sort)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *args: object) -> None:
            """Nothing is said."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def stamps(held: Held, at: dt.datetime) -> Callable[[bytes], Answer]:
    """What a time stamp server with a key answers at a time (RFC 3161, by pyHanko)."""
    store = SimpleCertificateStore()
    store.register_multiple([of_der(one) for one in held.chain])
    key = held.key.private_bytes(serialization.Encoding.DER, serialization.PrivateFormat.PKCS8,
                                 serialization.NoEncryption())  # fmt: skip
    server = DummyTimeStamper(of_der(held.certificate), keys.PrivateKeyInfo.load(key), store, fixed_dt=at)

    def answer(body: bytes) -> Answer:
        return 200, REPLY, server.request_tsa_response(tsp.TimeStampReq.load(body)).dump()

    return answer


def revocations(held: Held, *revoked: tuple[int, dt.datetime], at: dt.datetime = SIGNED) -> bytes:
    """A revocation list of an authority, DER."""
    builder = (
        certificates.CertificateRevocationListBuilder().issuer_name(held.certificate.subject)
        .last_update(at - dt.timedelta(days=1)).next_update(at + dt.timedelta(days=30))
        .add_extension(certificates.AuthorityKeyIdentifier.from_issuer_public_key(held.key.public_key()), critical=False)
        .add_extension(certificates.CRLNumber(1), critical=False)
    )  # fmt: skip
    for serial, since in revoked:
        builder = builder.add_revoked_certificate(
            certificates.RevokedCertificateBuilder().serial_number(serial).revocation_date(since).build()
        )
    return builder.sign(held.key, hashes.SHA256()).public_bytes(serialization.Encoding.DER)


def status(issuer: Held, *known: Held, at: dt.datetime = SIGNED) -> Callable[[bytes], Answer]:
    """What the responder of an authority (OCSP, RFC 6960) answers: good for the certificates that it knows."""
    by_number = {one.certificate.serial_number: one.certificate for one in known}

    def answer(body: bytes) -> Answer:
        asked = ocsp.load_der_ocsp_request(body)
        response = (
            ocsp.OCSPResponseBuilder()
            .add_response(by_number[asked.serial_number], issuer.certificate, hashes.SHA1(),
                          ocsp.OCSPCertStatus.GOOD, at - dt.timedelta(hours=1), at + dt.timedelta(days=7), None, None)
            .responder_id(ocsp.OCSPResponderEncoding.HASH, issuer.certificate)
        )  # fmt: skip
        for extension in asked.extensions:
            response = response.add_extension(extension.value, critical=False)
        signed = response.sign(issuer.key, hashes.SHA256())
        return 200, "application/ocsp-response", signed.public_bytes(serialization.Encoding.DER)

    return answer


def of_der(certificate: certificates.Certificate) -> x509.Certificate:
    return x509.Certificate.load(certificate.public_bytes(serialization.Encoding.DER))
