"""isomesh turns medical volumes into surface meshes. This package does it in this process, without a server.

    import isomesh_kernels

    mesh = isomesh_kernels.mesh(scan, affine=image.affine, iso=60)
    mesh.vertices  # float32 (n, 3), millimetres, LPS
    mesh.faces     # uint32 (m, 3)

A mesh is an `isomesh_client.Mesh`. `Mesher` has the shape of zmesh's.
"""

from .library import set_threads
from .mesher import Mesher
from .meshing import mesh
from .version import __version__

__all__ = ["Mesher", "__version__", "mesh", "set_threads"]
