"""isomesh turns medical volumes into surface meshes; this is the client of its server.

    import isomesh

    client = isomesh.Client("http://127.0.0.1:8080")
    mesh = client.mesh("head.nii.gz", iso=60)
    mesh.vertices  # (n, 3), millimetres, LPS
    mesh.faces     # (m, 3)

It needs nothing but the standard library. With numpy, meshes are its arrays and arrays can be
uploaded. `isomesh.api` has the types of what the server takes and answers.
"""

from .client import Client
from .errors import IsomeshError, JobFailed, Refused, Unreachable, WrongAnswer
from .mesh import Mesh, read_ply
from .uploads import Raw
from .version import __version__

__all__ = [
    "Client",
    "IsomeshError",
    "JobFailed",
    "Mesh",
    "Raw",
    "Refused",
    "Unreachable",
    "WrongAnswer",
    "__version__",
    "read_ply",
]
