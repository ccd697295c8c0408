"""PACS that are not Orthanc: the rows of the table in docs/hospital.md."""
import dataclasses
import struct

import dialects
import dicom
import peers
from fixture import Loop

WATCH = """
[[rules]]
name = "found"
watch = "main"
match = { modality = "CT", series-description = "*bone*", days = 3650 }
parameters = { iso = 500 }
send = [ { pacs = "main" } ]
"""


class Dialects(Loop):
    def speak(self, dialect, **how):
        self.proxy.close()
        self.proxy = dialects.Proxy(self.pacs.port, dataclasses.replace(dialect, **how))
        return self.proxy

    def ordered(self, dialect, slices=12, **how):
        """A series is ordered from such a PACS, and its mesh is stored there. Returns the order."""
        self.speak(dialect, **how)
        series = self.series(slices=slices, size=16)
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual(order["source"]["instances"], slices)
        self.assert_one_mesh(order, series)
        return order

    def test_azure(self):
        self.assertEqual(self.ordered(dialects.AZURE, 210)["attempts"], 0)

    def test_azure_whose_answer_is_lost(self):
        self.stored_after_a_lost_answer(dialects.AZURE, lag=4)

    def test_google(self):
        self.assertEqual(self.ordered(dialects.GOOGLE, 101)["attempts"], 0)

    def test_aws(self):
        self.assertEqual(self.ordered(dialects.AWS)["attempts"], 0)

    def test_dcm4chee(self):
        self.assertEqual(self.ordered(dialects.DCM4CHEE, 120)["attempts"], 0)

    def test_kheops(self):
        self.assertEqual(self.ordered(dialects.KHEOPS)["attempts"], 0)

    def test_a_smaller_limit(self):
        self.assertEqual(self.ordered(dialects.SMALL)["attempts"], 0)

    def test_dicomweb_server(self):
        self.assertEqual(self.ordered(dialects.DCMJS, 120)["attempts"], 0)

    def test_dicomcloud(self):
        self.assertEqual(self.ordered(dialects.DICOMCLOUD, 30)["attempts"], 0)

    def test_uids_in_a_query_that_are_ignored(self):
        self.assertEqual(self.ordered(dialects.NO_MATCHING)["attempts"], 0)

    def test_a_list_that_is_cut_fails_with_its_reason(self):
        self.speak(dialects.DCM4CHEE, offset=False)
        daemon = self.daemon()
        order = daemon.ended(self.order(daemon, self.series(slices=60, size=16)))
        self.assertEqual(order["state"], "failed")
        self.assertIn("lists only 50 instances", order["error"]["detail"])

    def test_a_list_that_is_too_short_says_so(self):
        self.speak(dialects.DCM4CHEE, offset=False, warns=False)
        daemon = self.daemon()
        identity = self.order(daemon, self.series(slices=60, size=16))
        peers.until(lambda: daemon.get(identity)["attempts"] >= 1)
        self.assertIn("lists 50 instances of the series, but says that it has 60",
                      daemon.get(identity)["error"]["detail"])

    def stored_after_a_lost_answer(self, dialect, **how):
        self.speak(dialect, **how).lose_stored = 1
        series = self.series()
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual(order["attempts"], 1)  # the answer that was lost
        self.assert_one_mesh(order, series)
        stored = [(each["direction"], each["outcome"]) for each in daemon.audit() if each["event"] == "110104"]
        self.assertEqual(stored, [("in", "success"), ("out", "failure"), ("out", "success")])

    def test_a_lost_answer_and_a_slow_index(self):
        self.stored_after_a_lost_answer(dialects.SLOW_INDEX)

    def test_an_object_that_is_never_found_is_tried_again(self):
        self.speak(dialects.SLOW_INDEX, lag=3600)
        daemon = self.daemon()
        identity = self.order(daemon, self.series())
        peers.until(lambda: daemon.get(identity)["attempts"] >= 1)
        order = daemon.get(identity)
        self.assertEqual(order["state"], "sending")
        self.assertIn("says that it has the mesh, but does not find it", order["error"]["detail"])

    def test_watches(self):
        for dialect in (dialects.AWS, dialects.RELATIONAL_QUERY_REJECTED, dialects.AZURE):
            self.speak(dialect)
            series = self.series(description="Head BONE")
            daemon = self.daemon(rules=WATCH)

            def mine():
                found = daemon.call("GET", "/v1/orders?rule=found")[2]["orders"]
                return [each for each in found if each["source"]["series"] == series.uid]
            order = peers.until(mine)[0]
            self.assertEqual(order["source"]["study"], series.study)
            self.succeeded(daemon, order["id"])
            daemon.kill()

    def test_forms_that_are_read(self):
        for form in ("gzip", "line feeds", "blanks"):
            with self.subTest(form):
                self.assertEqual(self.ordered(dialects.Dialect(retrieve=form))["attempts"], 0)

    def failed(self, dialect, series=None, **how):
        """What the order says that fails at once."""
        self.speak(dialect, **how)
        daemon = self.daemon()
        order = daemon.ended(self.order(daemon, series or self.series()))
        self.assertEqual((order["state"], order["attempts"]), ("failed", 0))
        return order["error"]["detail"]

    def test_forms_that_cannot_be_read_fail_at_once(self):
        for form, reason in [("no boundary", "no usable boundary"), ("zip", "another form than multipart/related"),
                             ("unknown encoding", "Content-Encoding")]:
            with self.subTest(form):
                self.assertIn(reason, self.failed(dialects.Dialect(retrieve=form)))
        self.assertIn("set transfer-syntax", self.failed(dialects.Dialect(syntaxes=())))

    def test_a_transfer_syntax_that_cannot_be_read_fails_at_once(self):
        series = dicom.Series(self.uid())
        mpeg = b"1.2.840.10008.1.2.4.100\0"
        known = dicom.element(0x00020010, "UI", dicom.EXPLICIT_LITTLE_ENDIAN)
        unknown = dicom.element(0x00020010, "UI", mpeg)
        for name, file in series.files.items():
            begin = dicom.encapsulated(file).replace(known, unknown)
            length = struct.unpack("<I", begin[140:144])[0] + len(unknown) - len(known)
            series.files[name] = begin[:140] + struct.pack("<I", length) + begin[144:]
        self.pacs.upload(series.files.values())
        detail = self.failed(dialects.Dialect(), series)
        self.assertIn("1.2.840.10008.1.2.4.100", detail)
        self.assertIn("set transfer-syntax of this PACS", detail)

    def test_a_single_file_is_a_series_of_one(self):
        """It is read, and is no volume of several slices."""
        detail = self.failed(dialects.Dialect(retrieve="one file"), self.series(slices=1))
        self.assertNotIn("multipart", detail)
