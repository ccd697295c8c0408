"""Authorities and their certificates, made by openssl."""
import os
import subprocess


class Authority:
    def __init__(self, folder, name):
        self.folder = os.path.join(folder, name)
        os.makedirs(self.folder)
        self.file = os.path.join(self.folder, "authority.pem")
        self.key = os.path.join(self.folder, "authority.key")
        self._run("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2",
                  "-subj", f"/CN={name}", "-keyout", self.key, "-out", self.file)

    @staticmethod
    def _run(*arguments):
        subprocess.run(["openssl", *arguments], check=True, capture_output=True)

    def issue(self, name, days=2):
        """A certificate for that name, or for 127.0.0.1 if that is it; it and its key."""
        key, request, certificate, extension = (
            os.path.join(self.folder, f"{name}{days}.{kind}") for kind in ("key", "csr", "pem", "ext"))
        kind = "IP" if name == "127.0.0.1" else "DNS"
        with open(extension, "w", encoding="utf-8") as file:
            file.write(f"subjectAltName={kind}:{name}\n")
        self._run("req", "-newkey", "rsa:2048", "-nodes", "-subj", f"/CN={name}",
                  "-keyout", key, "-out", request)
        self._run("x509", "-req", "-in", request, "-CA", self.file, "-CAkey", self.key,
                  "-CAcreateserial", "-days", str(days), "-extfile", extension, "-out", certificate)
        return certificate, key
