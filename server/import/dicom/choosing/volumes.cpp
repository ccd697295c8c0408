#include "server/import/dicom/choosing/volumes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <span>

#include "base/text.h"
#include "server/import/dicom/geometry/attributes.h"
#include "server/import/dicom/geometry/placement.h"
#include "server/import/dicom/geometry/vectors.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import::dicom {
namespace {

using Slices = std::vector<Slice>;

constexpr std::uint64_t kMostPlaces = std::uint64_t{1} << 28;
// For more slices than this, only single attributes are tried.
constexpr std::size_t kManySlices = std::size_t{1} << 16;

std::string phase_of(const Slice& slice, std::size_t attribute) {
  for (const auto* phases : {&slice.frame->phases, &slice.image->phases}) {
    const auto found = std::ranges::find(*phases, attribute, &Phase::attribute);
    if (found != phases->end()) return found->value;
  }
  return {};
}

// Orders numbers by value, before texts in alphabetical order.
bool is_before(const std::string& a, const std::string& b) {
  const auto one = finite_number(a);
  const auto other = finite_number(b);
  if (one && other && *one != *other) return *one < *other;
  if (one.has_value() != other.has_value()) return one.has_value();
  return a < b;
}

// An attribute that may distinguish frames: each slice's value, by its rank.
struct Criterion {
  std::string name;
  std::vector<std::string> values;   // ascending
  std::vector<std::uint32_t> ranks;  // one per slice
};

Criterion criterion_of(std::string name, const std::vector<std::string>& of_slices) {
  std::set<std::string, decltype(&is_before)> distinct(of_slices.begin(), of_slices.end(),
                                                       &is_before);
  Criterion criterion = {std::move(name), {distinct.begin(), distinct.end()}, {}};
  std::map<std::string, std::uint32_t> ranks;
  for (const std::string& value : criterion.values) {
    ranks.emplace(value, static_cast<std::uint32_t>(ranks.size()));
  }
  for (const std::string& value : of_slices) criterion.ranks.push_back(ranks.at(value));
  return criterion;
}

// The slices of one orientation, size and spacing, with their positions.
struct Positions {
  std::vector<std::uint32_t> of_slices;
  std::uint32_t count = 0;
  std::uint32_t most_at_one = 0;
};

Positions positions_of(const std::vector<Placed>& placed) {
  const std::vector<std::size_t> starts = position_starts(placed);
  Positions positions;
  for (std::size_t at = 0; at < starts.size(); ++at) {
    const std::size_t end = at + 1 < starts.size() ? starts[at + 1] : placed.size();
    positions.most_at_one =
        std::max(positions.most_at_one, static_cast<std::uint32_t>(end - starts[at]));
    positions.of_slices.resize(end, static_cast<std::uint32_t>(at));
  }
  positions.count = static_cast<std::uint32_t>(starts.size());
  return positions;
}

// Two whole volumes show that a series has several. One suffices if the other one was interrupted:
// the attribute is a step of the protocol, and the last step has fewer slices, but more than one. A
// slice that was taken twice is no step.
bool are_plausible(const std::vector<std::uint32_t>& counts,
                   std::span<const Criterion* const> criteria, std::uint32_t positions) {
  const auto whole = std::ranges::count(counts, positions);
  if (whole >= 2) return true;
  return counts.size() == 2 && counts.front() == positions && counts.back() > 1 &&
         criteria.size() == 1 && is_planned(criteria.front()->name);
}

// Assigns a volume to each slice by its values of the criteria. Empty unless the number of volumes
// equals the slices at one position, no volume has two slices at one position, and the volumes are
// plausible.
std::optional<std::vector<std::uint32_t>> volumes_by(std::span<const Criterion* const> criteria,
                                                     const Positions& positions) {
  // Too few values for that many volumes, or more combinations than any real series has.
  std::uint64_t combinations = 1;
  for (const Criterion* criterion : criteria) combinations *= criterion->values.size();
  const std::uint64_t places = std::uint64_t{positions.most_at_one} * positions.count;
  if (combinations < positions.most_at_one || places > kMostPlaces) return std::nullopt;
  std::vector<std::uint64_t> keys(positions.of_slices.size());
  for (const Criterion* criterion : criteria) {
    for (std::size_t i = 0; i < keys.size(); ++i) {
      keys[i] = keys[i] * criterion->values.size() + criterion->ranks[i];
    }
  }
  std::vector<std::uint64_t> distinct = keys;
  std::ranges::sort(distinct);
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  if (distinct.size() != positions.most_at_one) return std::nullopt;
  std::vector<bool> taken(distinct.size() * positions.count);
  std::vector<std::uint32_t> counts(distinct.size());
  std::vector<std::uint32_t> volumes;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const auto volume = std::ranges::lower_bound(distinct, keys[i]) - distinct.begin();
    const std::size_t place =
        static_cast<std::size_t>(volume) * positions.count + positions.of_slices[i];
    if (taken[place]) return std::nullopt;
    taken[place] = true;
    ++counts[static_cast<std::size_t>(volume)];
    volumes.push_back(static_cast<std::uint32_t>(volume));
  }
  if (!are_plausible(counts, criteria, positions.count)) return std::nullopt;
  return volumes;
}

// True if it has several values, but no more than possible volumes.
bool is_useful(const Criterion& criterion, const Positions& positions) {
  return criterion.values.size() > 1 && criterion.values.size() <= positions.most_at_one;
}

// Each slice's instance number, or its file's index if that is missing.
std::vector<std::string> objects_of(const std::vector<Placed>& placed) {
  std::vector<std::string> objects;
  for (const Placed& each : placed) {
    const auto& number = each.slice.image->instance_number;
    objects.push_back(number ? std::to_string(*number)
                             : "of file " + std::to_string(each.slice.file + 1));
  }
  return objects;
}

Criterion criterion_at(std::size_t attribute, const std::vector<Placed>& placed) {
  std::vector<std::string> values;
  for (const Placed& each : placed) values.push_back(phase_of(each.slice, attribute));
  return criterion_of(std::string(phase_names()[attribute]), values);
}

std::vector<Criterion> criteria_of(const std::vector<Placed>& placed, const Positions& positions) {
  std::vector<Criterion> criteria;
  for (std::size_t attribute = 0; attribute < phase_names().size(); ++attribute) {
    Criterion criterion = criterion_at(attribute, placed);
    if (is_useful(criterion, positions)) criteria.push_back(std::move(criterion));
  }
  Criterion objects = criterion_of("InstanceNumber", objects_of(placed));
  if (is_useful(objects, positions)) criteria.push_back(std::move(objects));
  return criteria;
}

// A slice's number in the order of acquisition, in its series or in its object.
std::vector<std::int64_t> acquisition_order(const std::vector<Placed>& placed) {
  const bool one_object = std::ranges::all_of(
      placed, [&](const Placed& each) { return each.slice.file == placed.front().slice.file; });
  std::vector<std::int64_t> order;
  for (const Placed& each : placed) {
    const auto number = one_object ? std::optional<std::int64_t>(each.slice.frame->number)
                                   : each.slice.image->instance_number;
    if (!number) return {};
    order.push_back(*number);
  }
  return order;
}

// Assigns a volume to each slice by the order of acquisition: volume by volume, or position by
// position. Empty for any other order.
std::optional<std::vector<std::uint32_t>> volumes_by_order(const std::vector<Placed>& placed,
                                                           const Positions& positions) {
  const std::vector<std::int64_t> order = acquisition_order(placed);
  const std::size_t count = positions.most_at_one;
  if (order.empty() || placed.size() != count * positions.count) return std::nullopt;
  std::vector<std::size_t> sorted(placed.size());
  std::iota(sorted.begin(), sorted.end(), std::size_t{0});
  std::ranges::sort(sorted, {}, [&](std::size_t slice) { return order[slice]; });
  for (const bool by_volume : {true, false}) {
    std::vector<std::uint32_t> volumes(placed.size());
    std::vector<bool> taken(placed.size());
    bool is_whole = true;
    for (std::size_t at = 0; at < sorted.size() && is_whole; ++at) {
      const std::size_t volume = by_volume ? at / positions.count : at % count;
      const std::size_t place = volume * positions.count + positions.of_slices[sorted[at]];
      // Duplicate numbers define no order.
      is_whole = !taken[place] && (at == 0 || order[sorted[at - 1]] != order[sorted[at]]);
      taken[place] = true;
      volumes[sorted[at]] = static_cast<std::uint32_t>(volume);
    }
    if (is_whole) return volumes;
  }
  return std::nullopt;
}

// "EchoTime 4.92, 20 slices"
std::string title_of(std::span<const Criterion* const> criteria, std::size_t slice,
                     std::size_t slices) {
  std::string title;
  for (const Criterion* criterion : criteria) {
    const std::string& value = criterion->values[criterion->ranks[slice]];
    title += criterion->name + ' ' + (value.empty() ? "unknown" : value) + ", ";
  }
  return title + count_of(slices, "slice");
}

// "instances 21 to 40, ", for volumes that differ in nothing else.
std::string range_of(const std::vector<Placed>& placed, const std::vector<std::int64_t>& order,
                     const std::vector<std::uint32_t>& volumes, std::size_t volume) {
  std::int64_t first = std::numeric_limits<std::int64_t>::max();
  std::int64_t last = std::numeric_limits<std::int64_t>::min();
  for (std::size_t i = 0; i < placed.size(); ++i) {
    if (volumes[i] != volume) continue;
    first = std::min(first, order[i]);
    last = std::max(last, order[i]);
  }
  const bool one_object = placed.front().slice.file == placed.back().slice.file;
  const std::int64_t base = one_object ? 1 : 0;  // frames are numbered from 1 for people
  return (one_object ? "frames " : "instances ") + std::to_string(first + base) + " to " +
         std::to_string(last + base) + ", ";
}

std::vector<SeriesVolume> gathered(const std::vector<Placed>& placed,
                                   const std::vector<std::uint32_t>& volumes,
                                   std::span<const Criterion* const> criteria) {
  std::vector<SeriesVolume> result(std::ranges::max(volumes) + std::size_t{1});
  std::vector<std::size_t> firsts(result.size());
  for (std::size_t i = 0; i < placed.size(); ++i) {
    if (result[volumes[i]].slices.empty()) firsts[volumes[i]] = i;
    result[volumes[i]].slices.push_back(placed[i].slice);
  }
  for (std::size_t at = 0; at < result.size(); ++at) {
    result[at].title = title_of(criteria, firsts[at], result[at].slices.size());
  }
  return result;
}

// Marks those that were interrupted: they have fewer slices than the others.
std::vector<SeriesVolume> with_interrupted(std::vector<SeriesVolume> volumes) {
  std::size_t most = 0;
  for (const SeriesVolume& volume : volumes) most = std::max(most, volume.slices.size());
  for (SeriesVolume& volume : volumes) {
    if (volume.slices.size() == most) continue;
    volume.whole_count = most;
    volume.title += " of " + std::to_string(most);
  }
  return volumes;
}

std::string names_of(std::span<const Criterion* const> criteria) {
  std::string names;
  for (const Criterion* criterion : criteria) {
    names += (names.empty() ? "" : " and ") + criterion->name;
  }
  return names;
}

// Calls `use` with each one, then each two, then each three of the criteria, until it returns true.
template <class Use>
bool for_few(const std::vector<Criterion>& criteria, std::size_t slices, const Use& use) {
  std::vector<const Criterion*> chosen;
  const auto choose = [&](auto&& self, std::size_t from, std::size_t count) -> bool {
    if (count == 0) return use(std::span<const Criterion* const>(chosen));
    for (std::size_t at = from; at < criteria.size(); ++at) {
      chosen.push_back(&criteria[at]);
      if (self(self, at + 1, count - 1)) return true;
      chosen.pop_back();
    }
    return false;
  };
  const std::size_t most = slices > kManySlices ? 1 : 3;
  for (std::size_t count = 1; count <= most; ++count) {
    if (choose(choose, 0, count)) return true;
  }
  return false;
}

// Texts that differ in their last digits say nothing of volumes.
bool are_alike(const std::string& a, const std::string& b) {
  const auto one = finite_number(a);
  const auto other = finite_number(b);
  return one && other && std::abs(*one - *other) <= 0.01 * std::abs(*other);
}

// True if the slices of each value are evenly spaced, all alike, and those of several values
// alternate: a second echo may lie half a slice further than the first. Values that slices have by
// the order of their acquisition have fewer slices each.
bool are_interleaved(const Criterion& criterion, const std::vector<Placed>& placed) {
  std::vector<std::vector<double>> along(criterion.values.size());
  std::size_t changes = 0;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    along[criterion.ranks[i]].push_back(placed[i].along);
    if (i > 0 && criterion.ranks[i] != criterion.ranks[i - 1]) ++changes;
  }
  const auto& values = criterion.values;
  if (std::ranges::adjacent_find(values, are_alike) != values.end()) return false;
  const auto usual = usual_gap(along.front());
  // Stacks that lie behind each other change once less than there are values.
  if (!usual || changes < along.size()) return false;
  return std::ranges::all_of(along, [&](const std::vector<double>& group) {
    const auto is_uneven = [&](double a, double b) {
      return std::abs(b - a - *usual) > kPlaceTolerance * *usual;
    };
    return group.size() > along.size() &&
           std::ranges::adjacent_find(group, is_uneven) == group.end();
  });
}

// The volumes of slices that are all at different positions; empty for one.
std::optional<SeriesVolumes> interleaved(const std::vector<Placed>& placed) {
  for (std::size_t attribute = 0; attribute < phase_names().size(); ++attribute) {
    if (!is_of_volumes(phase_names()[attribute])) continue;
    const Criterion criterion = criterion_at(attribute, placed);
    const bool is_known = std::ranges::find(criterion.values, "") == criterion.values.end();
    if (criterion.values.size() < 2 || !is_known || !are_interleaved(criterion, placed)) continue;
    const std::array chosen = {&criterion};
    return SeriesVolumes{criterion.name, gathered(placed, criterion.ranks, chosen)};
  }
  return std::nullopt;
}

SeriesVolumes split_by_phase(Slices slices) {
  const std::vector<Placed> placed = placed_along_normal(slices);
  const Positions positions = positions_of(placed);
  SeriesVolumes result;
  const auto whole = [&] {
    std::string title = count_of(slices.size(), "slice");
    return SeriesVolumes{"", {{std::move(title), std::move(slices), 0}}};
  };
  if (positions.count == 1) return whole();
  if (positions.most_at_one == 1) {
    auto several = interleaved(placed);
    return several ? std::move(*several) : whole();
  }
  const bool was_split = for_few(
      criteria_of(placed, positions), placed.size(), [&](std::span<const Criterion* const> chosen) {
        const auto volumes = volumes_by(chosen, positions);
        if (!volumes) return false;
        result = {names_of(chosen), with_interrupted(gathered(placed, *volumes, chosen))};
        return true;
      });
  if (was_split) return result;
  if (const auto volumes = volumes_by_order(placed, positions)) {
    SeriesVolumes ordered = {"the order of acquisition", gathered(placed, *volumes, {})};
    const std::vector<std::int64_t> order = acquisition_order(placed);
    for (std::size_t at = 0; at < ordered.volumes.size(); ++at) {
      std::string& title = ordered.volumes[at].title;
      title = range_of(placed, order, *volumes, at) + title;
    }
    return ordered;
  }
  return whole();
}

// Groups in the order of their first slices.
template <class IsSame>
std::vector<Slices> grouped(const Slices& slices, const IsSame& is_same) {
  // Real series have few groups. The limit bounds the time for others.
  constexpr std::size_t kMostGroups = 100;
  std::vector<Slices> groups;
  for (const Slice& slice : slices) {
    auto group = std::ranges::find_if(
        groups, [&](const Slices& each) { return is_same(each.front(), slice); });
    if (group == groups.end()) {
      if (groups.size() == kMostGroups) return {slices};
      group = groups.emplace(groups.end());
    }
    group->push_back(slice);
  }
  return groups;
}

bool is_tile(const Slice& slice) { return slice.image->tiles_per_row > 0; }

std::vector<Slices> mosaics_of(const Slices& slices) {
  std::map<std::pair<std::int64_t, std::size_t>, Slices> mosaics;
  for (const Slice& slice : slices) {
    mosaics[{slice.image->instance_number.value_or(0), slice.file}].push_back(slice);
  }
  std::vector<Slices> result;
  for (auto& [order, mosaic] : mosaics) result.push_back(std::move(mosaic));
  return result;
}

SeriesVolumes one_a_mosaic(const Slices& slices) {
  const std::vector<Slices> mosaics = mosaics_of(slices);
  // Placed at one position, so that split_by_phase finds the attributes in which they differ.
  std::vector<Placed> firsts;
  for (const Slices& mosaic : mosaics) firsts.push_back({mosaic.front(), 0});
  const auto count = static_cast<std::uint32_t>(mosaics.size());
  const Positions positions = {std::vector<std::uint32_t>(count), 1, count};
  const std::vector<Criterion> criteria = criteria_of(firsts, positions);
  std::vector<const Criterion*> chosen;
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0U);
  for_few(criteria, firsts.size(), [&](std::span<const Criterion* const> few) {
    const auto volumes = volumes_by(few, positions);
    if (!volumes) return false;
    order = *volumes;
    chosen.assign(few.begin(), few.end());
    return true;
  });
  SeriesVolumes result = {chosen.empty() ? "the order of acquisition" : names_of(chosen), {}};
  result.volumes.resize(count);
  for (std::uint32_t at = 0; at < count; ++at) {
    result.volumes[order[at]] = {title_of(chosen, at, mosaics[at].size()), mosaics[at], 0};
  }
  return result;
}

bool same_lattice(const Slice& a, const Slice& b) {
  return same_size(a, b) && same_orientation(a, b) && same_spacing(a, b);
}

// " of 256 x 256 samples with normal (0, 0, 1), 0.5 x 0.5 mm"
std::string described(const Slice& slice) {
  const Plane& plane = slice.frame->plane;
  std::string text = " of " + std::to_string(slice.image->layout.columns) + " x " +
                     std::to_string(slice.image->layout.rows) + " samples with normal ";
  char before = '(';
  for (const double part : cross(plane.along_row, plane.along_column)) {
    text += std::string(1, before) + (before == '(' ? "" : " ") +
            to_text(std::round(part * 1000) / 1000 + 0.0);
    before = ',';
  }
  return text + "), " + to_text(plane.spacing[0]) + " x " + to_text(plane.spacing[1]) + " mm";
}

}  // namespace

SeriesVolumes split_volumes(std::vector<Slice> slices) {
  if (std::ranges::all_of(slices, is_tile)) return one_a_mosaic(slices);
  std::vector<Slices> groups = grouped(slices, same_lattice);
  if (groups.size() == 1) return split_by_phase(std::move(groups.front()));
  SeriesVolumes result;
  result.difference = "orientation, size or pixel spacing";
  for (Slices& group : groups) {
    // A single slice beside a stack is not a volume. It is reported if nothing else is one.
    if (group.size() < 2) continue;
    const std::string lattice = described(group.front());
    SeriesVolumes parts = split_by_phase(std::move(group));
    for (SeriesVolume& part : parts.volumes) {
      part.title += lattice;
      result.volumes.push_back(std::move(part));
    }
  }
  if (result.volumes.size() < 2) return {"", {{"", std::move(slices), 0}}};
  return result;
}

}  // namespace isomesh::import::dicom
