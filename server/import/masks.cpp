#include "server/import/masks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "proto/samples.h"
#include "server/import/labels/combinations.h"
#include "server/import/labels/label_table.h"
#include "server/import/samples/transfer.h"
#include "server/import/source/scratch_folder.h"
#include "server/volume/canonical.h"
#include "server/volume/geometry.h"

namespace isomesh::import {
namespace {

std::string_view without_folders(std::string_view path) {
  return path.substr(path.find_last_of('/') + 1);
}

std::string without_suffix(std::string_view name) {
  std::filesystem::path stem = name;
  if (lower(stem.extension().string()) == ".gz") stem = stem.stem();
  return stem.stem().string();
}

// "GM" of "sub-01_label-GM_mask": masks of BIDS begin with the subject, which is no structure.
std::string structure_of(const std::string& stem) {
  constexpr std::string_view kEntity = "_label-";
  const std::size_t at = stem.find(kEntity);
  if (at == std::string::npos) return stem;
  const std::string rest = stem.substr(at + kEntity.size());
  const std::string label = rest.substr(0, rest.find('_'));
  return label.empty() ? stem : label;
}

// in_quotes() would cut the name of a file in folders.
std::string name_in_quotes(std::string_view file) {
  constexpr std::size_t kMostBytes = 200;
  return '"' + printable(beginning(file, kMostBytes)) + '"';
}

std::string sizes_of(const Volume& volume) {
  const auto& [x, y, z] = volume.dims;
  return std::to_string(x) + " x " + std::to_string(y) + " x " + std::to_string(z) + " samples";
}

// The largest distance between the corners of two grids of the same size.
double distance_of_grids(const Volume& one, const Volume& other) {
  double farthest = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    std::array<double, 3> between = {};
    for (std::size_t at = 0; at < 3; ++at) {
      between[at] = one.geometry.origin[at] - other.geometry.origin[at];
      for (int axis = 0; axis < 3; ++axis) {
        const double steps =
            (corner >> axis & 1U) * (one.dims[static_cast<std::size_t>(axis)] - 1.0);
        between[at] += steps * (volume::step_of(one.geometry, axis)[at] -
                                volume::step_of(other.geometry, axis)[at]);
      }
    }
    farthest = std::max(farthest, std::hypot(between[0], between[1], between[2]));
  }
  return farthest;
}

// Programs round the geometry in their headers, which moves samples by less.
constexpr double kSameGrid = 0.01;  // of the smallest spacing

constexpr const char* kOneGrid = " All masks of an upload need the same grid.";

void check_grid(const Volume& mask, const std::string& first_file, const Volume& first) {
  if (mask.dims != first.dims) {
    throw_unusable("It has " + sizes_of(mask) + ", but " + name_in_quotes(first_file) + " has " +
                   sizes_of(first) + '.' + kOneGrid);
  }
  const double distance = distance_of_grids(first, mask);
  if (distance <= kSameGrid * std::ranges::min(first.geometry.spacing)) return;
  throw_unusable("Its samples lie up to " + to_text(std::ceil(distance * 1000) / 1000) +
                 " mm from those of " + name_in_quotes(first_file) + '.' + kOneGrid);
}

// The value inside of a mask; 0 if it is empty. Throws Error kUnusableVolume unless all samples are
// this value or 0. Floats may be a little off, as after resampling.
double value_inside(std::span<const std::byte> samples, const Volume& mask) {
  const auto [low, high] = mask.range;
  // The farthest sample may be off in one direction, and the nearest in the other.
  const double inside = std::abs(low) > std::abs(high) ? low : high;
  constexpr double kNearly = 1e-3;
  const double tolerance = is_integer(mask.type) ? 0 : kNearly * std::min(1.0, std::abs(inside));
  const bool is_mask = with_sample(mask.type, [&](auto sample) {
    using Sample = decltype(sample);
    const std::span typed(reinterpret_cast<const Sample*>(samples.data()),
                          samples.size() / sizeof(Sample));
    return std::ranges::all_of(typed, [&](Sample value) {
      const auto number = static_cast<double>(value);
      return std::abs(number) <= tolerance || std::abs(number - inside) <= 2 * tolerance;
    });
  });
  if (is_mask) return inside;
  throw_unusable(
      "It is not a mask: its samples are not 0 outside of a structure and one other "
      "value inside, but have several values from " +
      to_text(low) + " to " + to_text(high) + ". Leave this file out.");
}

// Adds `label` to the samples of a mask that are nearer to the value inside than to 0. Returns
// false if there is none.
bool add(std::span<const std::byte> samples, SampleType type, double inside, std::uint32_t label,
         std::span<Combinations::State> states, Combinations& combinations) {
  bool is_any = false;
  with_sample(type, [&](auto sample) {
    using Sample = decltype(sample);
    const std::span typed(reinterpret_cast<const Sample*>(samples.data()), states.size());
    for (std::size_t at = 0; at < states.size(); ++at) {
      if (std::abs(static_cast<double>(typed[at])) <= std::abs(inside) / 2) continue;
      states[at] = combinations.with(states[at], label);
      is_any = true;
    }
  });
  return is_any;
}

// The masks that have been read, in one lattice of the states of samples. It is a mapped file,
// which may be larger than the memory of an import.
class Union {
 public:
  Union(const std::vector<Mask>& masks, const ImportTask& task)
      : masks_(masks),
        task_(task),
        part_(task),
        combinations_(static_cast<std::uint32_t>(masks.size())) {
    part_.scratch = folder_.path();
    part_.target = part_.scratch / "mask";
    for (std::size_t at = 0; at < masks.size(); ++at) {
      try {
        read(at);
      } catch (const Error& error) {
        throw error.with_detail(name_in_quotes(masks[at].file) + ": " + error.what());
      }
    }
  }
  Union(const Union&) = delete;
  Union& operator=(const Union&) = delete;

  // `names` are those of the masks.
  Volume write(const std::vector<std::string>& names) {
    if (entries_.empty()) {
      throw_unusable("All masks of the upload are empty: no sample of them is set.");
    }
    for (LabelEntry& entry : entries_) {
      entry.name = label_name(names[static_cast<std::size_t>(entry.label - 1)]);
    }
    for (const SampleType type : {SampleType::kUint8, SampleType::kUint16}) {
      if (masks_.size() > 0xFF && type == SampleType::kUint8) continue;
      check_limits(volume_.sample_count(), type, task_.limits);
      volume_.type = type;
      CanonicalWriter writer(task_.target, {volume_.dims, type, volume_.geometry});
      Combinations numbered = combinations_;
      if (!write(numbered, writer.samples())) continue;
      numbered.sort_values(type, writer.samples());
      volume_.labels = numbered.entries(std::move(entries_));
      if (auto note = numbered.note()) volume_.notes.push_back(std::move(*note));
      return finish(writer, std::move(volume_));
    }
    throw Error(ErrorCode::kInternal, "No sample type can hold the labels of masks.");
  }

 private:
  std::span<Combinations::State> states() {
    return {reinterpret_cast<Combinations::State*>(states_->samples().data()),
            static_cast<std::size_t>(volume_.sample_count())};
  }

  void read(std::size_t at) {
    std::filesystem::remove(part_.target);
    const Volume mask = masks_[at].read(part_);
    const volume::CanonicalVolume samples(part_.target);
    if (at == 0) {
      begin(mask);
    } else {
      check_grid(mask, masks_[0].file, volume_);
    }
    const double inside = value_inside(samples.samples(), mask);
    const auto label = static_cast<std::uint32_t>(at + 1);
    if (add(samples.samples(), mask.type, inside, label, states(), combinations_)) {
      entries_.push_back({.label = label});
    } else if (volume_.ignored.size() < kMostIgnored) {
      volume_.ignored.push_back(
          {printable(without_folders(masks_[at].file)), "no sample of this mask is set"});
    }
    take_notes(mask);
  }

  void begin(const Volume& mask) {
    volume_.format = mask.format;
    volume_.dims = mask.dims;
    volume_.geometry = mask.geometry;
    volume_.stored_axes = mask.stored_axes;
    constexpr SampleType kStateType = SampleType::kUint32;
    check_limits(volume_.sample_count(), kStateType, task_.limits);
    states_.emplace(part_.scratch / "states",
                    volume::CanonicalHeader{mask.dims, kStateType, mask.geometry});
  }

  // One of each kind; that it looks like labels is no news.
  void take_notes(const Volume& mask) {
    for (const Note& note : mask.notes) {
      const bool is_known = note.code == describe(NoteCode::kLooksLikeLabels).name ||
                            std::ranges::count(volume_.notes, note.code, &Note::code) > 0;
      if (!is_known) volume_.notes.push_back(note);
    }
  }

  bool write(Combinations& numbered, std::span<std::byte> target) {
    constexpr std::size_t kPiece = std::size_t{1} << 18;
    const std::size_t bytes = bytes_per_sample(volume_.type);
    for (std::size_t at = 0; at < states().size(); at += kPiece) {
      const auto piece = states().subspan(at, std::min(kPiece, states().size() - at));
      if (!numbered.write(piece, volume_.type, target.subspan(at * bytes, piece.size() * bytes))) {
        return false;
      }
    }
    return true;
  }

  static constexpr std::size_t kMostIgnored = 100;

  const std::vector<Mask>& masks_;
  const ImportTask& task_;
  TemporaryFolder folder_{task_.scratch, "masks-"};
  ImportTask part_;  // of a single mask
  Combinations combinations_;
  Volume volume_;
  std::vector<LabelEntry> entries_;
  std::optional<CanonicalWriter> states_;
};

}  // namespace

std::vector<std::string> mask_names(const std::vector<std::string>& files) {
  using Form = std::string (*)(const std::string& file);
  constexpr std::array<Form, 3> kForms = {
      [](const std::string& file) { return structure_of(without_suffix(without_folders(file))); },
      [](const std::string& file) {
        return file.substr(0, file.size() - without_folders(file).size()) +
               without_suffix(without_folders(file));
      },
      [](const std::string& file) { return file; }};
  std::vector<std::string> names(files.size());
  for (const Form form : kForms) {
    std::map<std::string, std::size_t> counts;
    for (const std::string& name : names) ++counts[name];
    for (std::size_t at = 0; at < files.size(); ++at) {
      if (names[at].empty() || counts[names[at]] > 1) names[at] = form(files[at]);
    }
  }
  return names;
}

Volume import_masks(const std::vector<Mask>& masks, const ImportTask& task) {
  if (masks.size() > Volume::kMostLabels) {
    throw_unusable("The upload has " + std::to_string(masks.size()) + " masks, more than the " +
                   std::to_string(Volume::kMostLabels) + " labels that a volume may have.");
  }
  Union all(masks, task);
  std::vector<std::string> files;
  for (const Mask& mask : masks) files.push_back(mask.file);
  return all.write(mask_names(files));
}

}  // namespace isomesh::import
