"""A digest as a mail: plain text and HTML, by SMTP."""

import smtplib
import ssl
from email.message import EmailMessage
from email.policy import SMTP
from email.utils import formatdate

from app.services.digests.mail_server import TimedSMTP
from app.services.digests.sending import Mail, NotSentError
from app.services.telling.naming import one_line
from app.settings import Settings

TIMEOUT_S = 15.0
WHOLE_S = 60.0
"""Until the mail is taken. Each byte of an answer may take the time above, and the audits wait behind this."""
GIVEN_UP = range(500, 600)


def message(settings: Settings, made: Mail, to: str) -> EmailMessage:
    """The policy refuses line ends in heads; the subject is one line already."""
    mail = EmailMessage(policy=SMTP)
    mail["Subject"] = made.subject
    mail["From"] = settings.digest_mail_from
    mail["To"] = to
    mail["Date"] = formatdate()
    mail["Message-ID"] = f"<{made.id}@loopaudit>"
    mail["Auto-Submitted"] = "auto-generated"
    mail.set_content(made.text)
    mail.add_alternative(made.html, subtype="html")
    return mail


def send_mail(settings: Settings, made: Mail, to: str) -> None:
    """Raises NotSentError with the server's own words; final where it will say the same again."""
    mail = message(settings, made, to)
    try:
        with _connected(settings) as server:
            if settings.digest_smtp_starttls:
                server.starttls(context=ssl.create_default_context())
            if settings.digest_smtp_user:
                server.login(settings.digest_smtp_user, settings.digest_smtp_password.get_secret_value())
            server.send_message(mail, settings.digest_mail_from, [to])
    except smtplib.SMTPRecipientsRefused as error:
        code, words = error.recipients[to]
        raise NotSentError(f"the mail server refused {to}: {code} {_words(words)}", final=code in GIVEN_UP) from error
    except smtplib.SMTPAuthenticationError as error:
        raise NotSentError(f"the mail server refused the login: {error.smtp_code}") from error
    except smtplib.SMTPResponseException as error:
        raise NotSentError(f"the mail server answered {error.smtp_code} {_words(error.smtp_error)}") from error
    except ssl.SSLCertVerificationError as error:
        host = settings.digest_smtp_host
        raise NotSentError(f"the certificate of the mail server {host} is refused: {error.verify_message}") from error
    except (smtplib.SMTPException, OSError) as error:
        raise NotSentError(f"the mail server cannot be used: {type(error).__name__}: {error}") from error


def _connected(settings: Settings) -> TimedSMTP:
    try:
        return TimedSMTP(settings.digest_smtp_host, settings.digest_smtp_port, TIMEOUT_S, WHOLE_S)
    except UnicodeError as error:
        raise NotSentError(f"the mail server {settings.digest_smtp_host} has a name that is none") from error


def _words(told: bytes | str) -> str:
    text = told.decode("utf-8", "replace") if isinstance(told, bytes) else told
    return one_line(text)[:300]
