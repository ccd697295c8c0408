"""3D Slicer: sends the volume or the segmentation that is open to an isomesh daemon, and loads the surfaces as models.

A scripted module of one file: Slicer, Edit, Application Settings, Modules, add this folder to the paths. It needs nothing but Slicer's Python.
"""

import contextlib
import http.client
import json
import os
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request

import slicer
from slicer.ScriptedLoadableModule import ScriptedLoadableModule, ScriptedLoadableModuleLogic, ScriptedLoadableModuleWidget


class NoRedirects(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_):
        return None


# Token and volume are for the daemon only: not for a proxy of the environment, nor for where a response leads.
DIRECTLY = urllib.request.build_opener(urllib.request.ProxyHandler({}), NoRedirects)


class Isomesh(ScriptedLoadableModule):
    def __init__(self, parent):
        super().__init__(parent)
        parent.title = "isomesh"
        parent.categories = ["Surface Models"]
        parent.helpText = "Surfaces of the open volume or segmentation, made by an isomesh daemon. Not a medical device."


LONGEST_BUSY_S = 600


class Busy(Exception):
    """The daemon wants the request again after so many seconds."""

    def __init__(self, reason, seconds):
        super().__init__(reason)
        self.seconds = seconds


class IsomeshLogic(ScriptedLoadableModuleLogic):
    def __init__(self, server, token=""):
        super().__init__()
        self.server = server.rstrip("/")
        self.headers = {"Authorization": f"Bearer {token}"} if token else {}

    def request(self, method, path, body=None, headers=None):
        return urllib.request.Request(self.server + path, data=body, method=method, headers={**self.headers, **(headers or {})})

    def ask(self, method, path, body=None, headers=None):
        """The bytes of the response. Raises RuntimeError with the daemon's reason. Waits while the daemon is busy, for ten minutes at most."""
        request = self.request(method, path, body, headers)
        begun = time.monotonic()
        while True:
            try:
                return self.ask_once(request)
            except Busy as busy:
                again = time.monotonic() + busy.seconds
                if again - begun > LONGEST_BUSY_S:
                    raise RuntimeError(f"isomesh: {busy}") from None
            while time.monotonic() < again:
                slicer.app.processEvents()
                time.sleep(0.05)

    def ask_once(self, request):
        try:
            with DIRECTLY.open(request) as response:
                return response.read()
        except urllib.error.HTTPError as error:
            text = error.read().decode("utf-8", "replace")
            try:
                reason = json.loads(text)["detail"]
            except (ValueError, KeyError, TypeError):
                reason = f"status {error.code}"
            if error.code in (429, 503):
                told = error.headers.get("Retry-After", "")
                raise Busy(reason, max(int(told), 1) if told.isdecimal() and len(told) < 10 else 1) from None
            raise RuntimeError(f"isomesh: {reason}") from None
        except (OSError, http.client.HTTPException) as error:
            reason = getattr(error, "reason", error)
            raise RuntimeError(f"isomesh: {self.server} cannot be reached: {reason}") from None

    def mesh(self, node, iso="otsu", max_error_mm=None, progress=lambda value, stage: None, allow_empty=False):
        """Loads the surfaces of a volume at `iso`, or of each segment of a segmentation, as models. Returns their nodes: none if
        the surface is empty and `allow_empty` is true. Otherwise that is a RuntimeError."""
        is_segmentation = node.IsA("vtkMRMLSegmentationNode")
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "volume.seg.nrrd" if is_segmentation else "volume.nrrd")
            if not slicer.util.saveNode(node, path):
                raise RuntimeError("isomesh: Slicer could not write the node")
            parameters = {"labels": "all", "close": True} if is_segmentation else {"iso": iso}
            if max_error_mm is not None:
                parameters["max_error_mm"] = max_error_mm
            job = self.job_of(self.upload(path), parameters, progress)
            if job["mesh"]["empty"] and not allow_empty:
                raise RuntimeError(f"isomesh: the surface is empty: {job['mesh'].get('empty_reason', '')}")
            surfaces = job["mesh"].get("labels") or [{"label": None, "name": node.GetName(), "color": None}]
            if job["mesh"].get("labels_count"):
                raise RuntimeError("isomesh: there are more than 256 segments. Mesh fewer of them")
            return [self.load(job["id"], each, folder) for each in surfaces if not job["mesh"]["empty"]]

    def upload(self, path):
        with open(path, "rb") as file:
            body = file.read()
        return json.loads(self.ask("POST", "/v1/volumes", body, {"Content-Type": "application/octet-stream"}))["id"]

    def job_of(self, volume, parameters, progress):
        body = json.dumps({"volume": volume, "formats": ["stl"], **parameters}).encode()
        job = json.loads(self.ask("POST", "/v1/jobs", body, {"Content-Type": "application/json"}))
        try:
            while job["state"] in ("queued", "running"):
                progress(job["progress"], job["stage"])
                slicer.app.processEvents()
                job = json.loads(self.ask("GET", f"/v1/jobs/{job['id']}?wait=1"))
        except BaseException:
            # The reason that ended the wait is told at once, not the failure of this request.
            with contextlib.suppress(RuntimeError, Busy):
                self.ask_once(self.request("DELETE", f"/v1/jobs/{job['id']}?erase=false"))
            raise
        if job["state"] != "succeeded":
            raise RuntimeError(f"isomesh: {job['error']['detail'] if job['error'] else job['state']}")
        return job

    def load(self, job, surface, folder):
        query = "" if surface["label"] is None else "?label=" + urllib.parse.quote(str(surface["label"]))
        # STL is in LPS, as Slicer expects of a file that does not say.
        path = os.path.join(folder, "surface.stl")
        with open(path, "wb") as file:
            file.write(self.ask("GET", f"/v1/jobs/{job}/mesh.stl{query}"))
        model = slicer.util.loadModel(path)
        model.SetName(surface["name"] or f"label {surface['label']}")
        if surface.get("color"):
            color = surface["color"].lstrip("#")
            model.GetDisplayNode().SetColor(*(int(color[at : at + 2], 16) / 255 for at in (0, 2, 4)))
        return model


class IsomeshWidget(ScriptedLoadableModuleWidget):
    def setup(self):
        super().setup()
        import ctk
        import qt

        form = qt.QFormLayout()
        self.layout.addLayout(form)
        self.server = qt.QLineEdit(os.environ.get("ISOMESH_SERVER", "http://127.0.0.1:8080"))
        self.token = qt.QLineEdit(os.environ.get("ISOMESH_TOKEN", ""))
        self.token.setEchoMode(qt.QLineEdit.Password)
        self.node = slicer.qMRMLNodeComboBox()
        self.node.nodeTypes = ["vtkMRMLScalarVolumeNode", "vtkMRMLSegmentationNode"]
        self.node.setMRMLScene(slicer.mrmlScene)
        self.iso = qt.QLineEdit("otsu")
        self.error = ctk.ctkDoubleSpinBox()
        self.error.suffix = " mm"
        self.error.setToolTip("The largest error of the surface; 0 sets no limit")
        self.button = qt.QPushButton("Make the surfaces")
        for name, widget in (
            ("Server", self.server),
            ("Token", self.token),
            ("Volume or segmentation", self.node),
            ("Iso-value (volumes)", self.iso),
            ("Largest error", self.error),
            ("", self.button),
        ):
            form.addRow(name, widget)
        self.button.connect("clicked(bool)", self.make)
        self.layout.addStretch(1)

    def make(self, _=False):
        node = self.node.currentNode()
        if node is None:
            slicer.util.errorDisplay("Choose a volume or a segmentation")
            return
        text = self.iso.text.strip()
        try:
            iso = float(text)
        except ValueError:
            iso = text
        logic = IsomeshLogic(self.server.text, self.token.text)
        with slicer.util.tryWithErrorDisplay("isomesh failed", waitCursor=True):
            logic.mesh(node, iso, self.error.value or None, lambda _, stage: slicer.util.showStatusMessage(stage))
