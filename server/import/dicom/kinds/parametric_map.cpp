#include "server/import/dicom/kinds/parametric_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "server/import/dicom/elements/tags.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

struct Mapping {
  Rescale rescale;
  // The stored values that it applies to; all if the object does not say.
  double first = -std::numeric_limits<double>::infinity();
  double last = std::numeric_limits<double>::infinity();

  bool covers(const Mapping& other) const { return first <= other.first && last >= other.last; }
  bool same_values(const Mapping& other) const {
    return rescale.slope == other.rescale.slope && rescale.intercept == other.rescale.intercept;
  }
};

[[noreturn]] void throw_mapping(const std::string& reason) {
  throw_unusable("The DICOM parametric map's samples cannot be mapped to real world values " +
                 tag_name(kRealWorldValueMappingSequence) + ": " + reason);
}

double required_real(const DataSet& item, Tag tag, const std::string& name) {
  const std::vector<double> numbers = item.binary_reals(tag);
  if (numbers.size() == 1 && std::isfinite(numbers[0])) return numbers[0];
  throw_mapping("the " + name + ' ' + tag_name(tag) + " is not a finite number.");
}

// The end of a range, which is a real number or of the same kind as the stored samples.
std::optional<double> end_of_range(const DataSet& item, Tag real, Tag word, bool is_signed) {
  const std::vector<double> numbers = item.binary_reals(real);
  if (numbers.size() == 1 && std::isfinite(numbers[0])) return numbers[0];
  const std::vector<std::uint32_t> words = item.unsigned_numbers(word);
  if (words.size() != 1) return std::nullopt;
  return is_signed ? static_cast<std::int16_t>(words[0]) : static_cast<double>(words[0]);
}

Mapping mapping_of(const DataSet& item, bool is_signed) {
  Mapping mapping;
  mapping.rescale = {required_real(item, kRealWorldValueSlope, "slope"),
                     required_real(item, kRealWorldValueIntercept, "intercept")};
  if (mapping.rescale.slope == 0) {
    throw_mapping("the slope " + tag_name(kRealWorldValueSlope) + " is 0.");
  }
  const auto first =
      end_of_range(item, kDoubleRealWorldValueFirst, kRealWorldValueFirst, is_signed);
  const auto last = end_of_range(item, kDoubleRealWorldValueLast, kRealWorldValueLast, is_signed);
  if (first && last) {
    mapping.first = *first;
    mapping.last = *last;
  }
  return mapping;
}

// Mappings with a slope and an intercept. Those that give the same values count once.
std::vector<Mapping> different_mappings(const Element& sequence, bool is_signed) {
  std::vector<Mapping> mappings;
  for (const DataSet& item : sequence.items) {
    if (item.find(kRealWorldValueLutData) != nullptr) continue;
    const Mapping mapping = mapping_of(item, is_signed);
    const auto same = std::ranges::find_if(
        mappings, [&](const Mapping& known) { return known.same_values(mapping); });
    if (same == mappings.end()) {
      mappings.push_back(mapping);
    } else {
      same->first = std::min(same->first, mapping.first);
      same->last = std::max(same->last, mapping.last);
    }
  }
  return mappings;
}

}  // namespace

bool is_parametric_map(const DataSet& data) {
  return data.text(kSopClassUid) == "1.2.840.10008.5.1.4.1.1.30";
}

std::uint32_t set_real_world_values(const Attributes& attributes, const PixelLayout& stored,
                                    Frame& frame) {
  const Element* sequence = attributes.sequence(kRealWorldValueMappingSequence);
  if (sequence == nullptr) return 0;
  const std::vector<Mapping> mappings = different_mappings(*sequence, stored.is_signed);
  if (mappings.empty()) {
    throw_mapping("it has only lookup tables " + tag_name(kRealWorldValueLutData) +
                  ". Mappings by slope and intercept are supported.");
  }
  const auto widest = std::ranges::find_if(mappings, [&](const Mapping& mapping) {
    return std::ranges::all_of(mappings,
                               [&](const Mapping& other) { return mapping.covers(other); });
  });
  if (widest == mappings.end()) {
    throw_mapping(
        "its " + std::to_string(mappings.size()) +
        " mappings apply to different stored values. One mapping for all stored values is "
        "supported.");
  }
  frame.rescale = widest->rescale;
  frame.has_slope = frame.has_intercept = true;
  return static_cast<std::uint32_t>(mappings.size());
}

}  // namespace isomesh::import::dicom
