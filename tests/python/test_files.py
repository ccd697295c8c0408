"""Files of meshes: their names, and how they appear."""

import errno
import os
import resource
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from isomesh_client import files
from limits import LimitedTest


class Files(LimitedTest):
    def test_the_umask_is_never_changed(self):
        """Another thread may make a file at that moment."""
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        folder = Path(place.name)
        before = os.umask(0o027)
        self.addCleanup(os.umask, before)
        with mock.patch.object(os, "umask", side_effect=AssertionError):
            for name in ("new", "n" * 255, "old"):
                if name == "old":
                    (folder / name).write_bytes(b"old")
                    (folder / name).chmod(0o666)
                with files.written(folder / name) as file:
                    file.write(b"mesh")
                    part = next(each for each in folder.iterdir() if each.name.endswith(".part"))
                    seen = part.stat().st_mode & 0o777
                self.assertEqual((folder / name).stat().st_mode & 0o777, 0o666 if name == "old" else 0o640)
                self.assertEqual(seen, 0o640)
        self.assertEqual(len(list(folder.iterdir())), 3)

    def test_nothing_remains_on_a_full_disk(self):
        with tempfile.TemporaryDirectory() as folder:
            limits = resource.getrlimit(resource.RLIMIT_FSIZE)
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
            try:
                with self.assertRaises(OSError) as caught, files.written(Path(folder) / "x.stl") as file:
                    file.write(bytes(3000))
                with self.assertRaises(KeyboardInterrupt), files.written(Path(folder) / "x.stl") as file:
                    file.write(bytes(3000))
                    raise KeyboardInterrupt
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            self.assertEqual(caught.exception.errno, errno.EFBIG)
            self.assertEqual(os.listdir(folder), [])

    def test_every_file_of_a_mesh_has_one_name(self):
        for name, names in (
            ("x y.tar.obj", ["x y.tar.obj", "x_y.tar.mtl"]),
            ("X.OBJ", ["X.OBJ", "X.mtl"]),
            ("a\\b\t.obj", ["a\\b\t.obj", "a_b_.mtl"]),
            ("x.stl", ["x.stl"]),
        ):
            target = Path("folder") / name
            self.assertEqual([file.name for file in files.files_of_mesh(target, True)], names)
            self.assertEqual(files.files_of_mesh(target, False), [target])


if __name__ == "__main__":
    unittest.main()
