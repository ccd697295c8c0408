"""isomesh turns medical volumes into surface meshes. This package is the client of its server.

    import isomesh_client

    client = isomesh_client.Client("http://127.0.0.1:8080")
    mesh = client.mesh("head.nii.gz", iso=60)
    mesh.vertices  # (n, 3), millimetres, LPS
    mesh.faces     # (m, 3)

The package needs the standard library only. With numpy, meshes are numpy arrays, and arrays can be
uploaded. `isomesh_client.api` has the types of the server's requests and responses.
"""

from . import api
from .batches import Result
from .client import Client
from .errors import EmptySurface, IsomeshError, JobFailed, Refused, Unreachable, VolumeWarning, WrongAnswer
from .mesh import Mesh, read_ply
from .uploads import Raw
from .version import __version__
from .viewer import View, view

__all__ = [
    "Client",
    "EmptySurface",
    "IsomeshError",
    "JobFailed",
    "Mesh",
    "Raw",
    "Refused",
    "Result",
    "Unreachable",
    "View",
    "VolumeWarning",
    "WrongAnswer",
    "__version__",
    "api",
    "read_ply",
    "view",
]
