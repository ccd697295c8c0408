#include "tests/unit/import/dicom/structures.h"

#include "server/import/dicom/elements/tags.h"

namespace isomesh::import::test {

using namespace dicom;

DicomObject structure_set(const std::vector<TestStructure>& structures) {
  std::vector<DicomObject> names;
  std::vector<DicomObject> contours;
  for (const TestStructure& structure : structures) {
    const std::string number = std::to_string(structure.number);
    names.push_back(
        DicomObject().text(kRoiNumber, "IS", number).text(kRoiName, "LO", structure.name));
    std::vector<DicomObject> items;
    for (const TestContour& contour : structure.contours) {
      std::string data;
      for (const Vector3& point : contour.points) {
        for (const double part : point) {
          data += (data.empty() ? "" : "\\") + std::to_string(part);
        }
      }
      items.push_back(DicomObject()
                          .text(kContourGeometricType, "CS", contour.type)
                          .text(kContourData, "DS", data));
    }
    contours.push_back(DicomObject()
                           .text(kRoiDisplayColor, "IS", structure.color)
                           .items(kContourSequence, items)
                           .text(kReferencedRoiNumber, "IS", number));
  }
  return DicomObject()
      .text(kSopClassUid, "UI", "1.2.840.10008.5.1.4.1.1.481.3")
      .text(kSopInstanceUid, "UI", "1.2.77")
      .text(kModality, "CS", "RTSTRUCT")
      .text(kSeriesDescription, "LO", "plan")
      .text(kSeriesInstanceUid, "UI", "1.2.9")
      .items(kReferencedFrameOfReferenceSequence,
             {DicomObject().text(kFrameOfReferenceUid, "UI", "1.2.3.frame")})
      .items(kStructureSetRoiSequence, names)
      .items(kRoiContourSequence, contours);
}

Points box(double left, double top, double right, double bottom, double z) {
  return {{left, top, z}, {right, top, z}, {right, bottom, z}, {left, bottom, z}};
}

}  // namespace isomesh::import::test
