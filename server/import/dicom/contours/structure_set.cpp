#include "server/import/dicom/contours/structure_set.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/labels/label_table.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::size_t kMostStructures = 0xFFFF;

std::uint32_t number_of(const DataSet& item, Tag tag) {
  const auto number = item.integer(tag);
  if (number && *number >= 0 && *number <= 0xFFFFFFFF) return static_cast<std::uint32_t>(*number);
  throw_unusable("The DICOM structure set has a structure whose number " + tag_name(tag) + " is " +
                 in_quotes(item.text(tag)) + ".");
}

std::map<std::uint32_t, std::string> names_of_structures(const DataSet& data) {
  std::map<std::uint32_t, std::string> names;
  for (const DataSet& item : data.items(kStructureSetRoiSequence)) {
    names.emplace(number_of(item, kRoiNumber), utf8(item, kRoiName));
  }
  return names;
}

std::optional<std::string> color_of(const DataSet& item) {
  constexpr double kMost = 255;
  const std::vector<double> parts = item.numbers(kRoiDisplayColor);
  if (parts.size() != 3) return std::nullopt;
  return label_color({parts[0] / kMost, parts[1] / kMost, parts[2] / kMost});
}

std::vector<Vector3> points_of(const DataSet& item, const std::string& where) {
  const std::vector<double> numbers = item.numbers(kContourData);
  if (numbers.empty() && item.text(kContourData).empty()) return {};
  if (numbers.empty() || numbers.size() % 3 != 0) {
    throw_unusable(where + " has coordinates " + tag_name(kContourData) +
                   " that are not triples of finite numbers.");
  }
  std::vector<Vector3> points;
  points.reserve(numbers.size() / 3);
  for (std::size_t at = 0; at < numbers.size(); at += 3) {
    points.push_back({numbers[at], numbers[at + 1], numbers[at + 2]});
  }
  // Some programs repeat the first point.
  while (points.size() > 1 && points.back() == points.front()) points.pop_back();
  return points;
}

bool is_closed(const DataSet& item) {
  const std::string_view type = item.text(kContourGeometricType);
  return type == "CLOSED_PLANAR" || type == "CLOSEDPLANAR_XOR";
}

void add_contours(const DataSet& item, Structure& structure, StructureSet& set) {
  std::size_t number = 0;
  for (const DataSet& contour : item.items(kContourSequence)) {
    std::vector<Vector3> points =
        points_of(contour, "Contour " + std::to_string(++number) + " of the DICOM structure " +
                               in_quotes(structure.name));
    if (is_closed(contour) && points.size() >= 3) {
      structure.contours.push_back(std::move(points));
    } else {
      ++set.skipped;
    }
  }
}

}  // namespace

bool is_structure_set(const DataSet& data) {
  return data.text(kSopClassUid) == "1.2.840.10008.5.1.4.1.1.481.3";
}

std::string frame_of_structures(const DataSet& data) {
  const DataSet* frame = data.item(kReferencedFrameOfReferenceSequence);
  const std::string_view uid =
      frame == nullptr ? std::string_view() : frame->text(kFrameOfReferenceUid);
  return std::string(uid.empty() ? data.text(kFrameOfReferenceUid) : uid);
}

StructureSet read_structures(const DataSet& data) {
  StructureSet set;
  set.frame_of_reference_uid = frame_of_structures(data);
  const auto names = names_of_structures(data);
  std::map<std::uint32_t, Structure> structures;
  for (const DataSet& item : data.items(kRoiContourSequence)) {
    const std::uint32_t number = number_of(item, kReferencedRoiNumber);
    Structure& structure = structures[number];
    structure.number = number;
    if (const auto name = names.find(number); name != names.end()) structure.name = name->second;
    if (!structure.color) structure.color = color_of(item);
    add_contours(item, structure, set);
  }
  for (auto& [number, structure] : structures) {
    if (structure.contours.empty()) continue;
    set.structures.push_back(std::move(structure));
  }
  std::set<std::uint32_t> numbers;
  for (const auto& [number, name] : names) numbers.insert(number);
  for (const auto& [number, structure] : structures) numbers.insert(number);
  set.empty = numbers.size() - set.structures.size();
  if (set.structures.empty()) {
    throw_unusable("The DICOM structure set has no closed contours in its " +
                   std::to_string(numbers.size()) + " structures, so it has no volume.");
  }
  if (set.structures.size() > kMostStructures) {
    throw_unusable("The DICOM structure set has more than the " + std::to_string(kMostStructures) +
                   " structures that can be labels.");
  }
  return set;
}

}  // namespace isomesh::import::dicom
