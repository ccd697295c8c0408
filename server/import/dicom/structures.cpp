#include "server/import/dicom/structures.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "base/text.h"
#include "server/import/dicom/contours/painter.h"
#include "server/import/dicom/contours/structure_set.h"
#include "server/import/dicom/elements/dataset.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/dicom/geometry/placement.h"
#include "server/import/labels/combinations.h"
#include "server/import/labels/label_table.h"
#include "server/import/samples/transfer.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::uint32_t kMostLabel = 0xFFFF;

// Structures keep their numbers if all are valid labels; otherwise they are numbered from 1.
void number_labels(std::vector<Structure>& structures) {
  const bool are_valid = std::ranges::all_of(structures, [](const Structure& each) {
    return each.number >= 1 && each.number <= kMostLabel;
  });
  if (are_valid) return;
  std::uint32_t next = 1;
  for (Structure& structure : structures) structure.number = next++;
}

void choose_structure(const ImportOptions& options, StructureSet& set) {
  if (!options.volume) return;
  if (*options.volume < set.structures.size()) {
    Structure chosen = std::move(set.structures[*options.volume]);
    set.structures.clear();
    set.structures.push_back(std::move(chosen));
    return;
  }
  std::vector<Choice> choices;
  for (const Structure& structure : set.structures) {
    choices.push_back(
        {"volume", std::to_string(choices.size()),
         printable(structure.name) + ", " + count_of(structure.contours.size(), "contour")});
  }
  throw_choice("The DICOM structure set has " +
                   count_of(set.structures.size(), "structure with contours") +
                   ", but no structure " + std::to_string(*options.volume) + '.',
               std::move(choices));
}

std::string length_text(double length) {
  constexpr double kPerMm = 1000;
  return to_text(length * kPerMm < 1 ? length : std::round(length * kPerMm) / kPerMm);
}

[[noreturn]] void throw_no_grid(const StructureSet& set) {
  const auto distance = usual_distance(set);
  const std::string planes =
      distance ? " Its contours are " + length_text(*distance) + " mm apart." : "";
  throw_unusable(
      "The DICOM structure set has no images in the upload that share its frame of reference. Add "
      "them, or add spacing=X,Y,Z (mm) for the grid on which its contours are drawn." +
      planes);
}

ContourGrid grid_of(const StructureSet& set, const std::optional<ContourGrid>& images,
                    const ImportOptions& options) {
  if (options.spacing) {
    for (const double step : *options.spacing) {
      if (!(std::isfinite(step) && step > 0)) {
        throw invalid_parameter("spacing", "must be three positive numbers");
      }
    }
    return grid_around(set, *options.spacing);
  }
  if (!images) throw_no_grid(set);
  return grid_of_images(set, *images);
}

// Says how to draw what the grid leaves out. The set still has its points.
std::string spacing_to_add(const StructureSet& set, const ContourGrid& grid,
                           const ImportOptions& options) {
  if (options.spacing) return "A smaller spacing=X,Y,Z (mm) draws smaller structures.";
  const auto& [x, y, z] = grid.geometry.spacing;
  return "Add spacing=X,Y,Z (mm), such as " + length_text(x) + ',' + length_text(y) + ',' +
         length_text(usual_distance(set).value_or(z)) +
         ", to draw on a grid of its own, around all contours and parallel to their planes.";
}

// Draws all structures of a set, slice by slice.
class Drawing {
 public:
  Drawing(StructureSet& set, const ContourGrid& grid) : grid_(grid) {
    const double set_distance = usual_distance(set).value_or(0) / grid.geometry.spacing[2];
    for (Structure& structure : set.structures) {
      highest_ = std::max(highest_, structure.number);
      painters_.emplace_back(structure.number,
                             Painter(structure, grid, std::max(set_distance, 1.0)));
    }
  }

  std::vector<SampleType> types() const {
    if (highest_ > 0xFF) return {SampleType::kUint16};
    return {SampleType::kUint8, SampleType::kUint16};
  }

  // Returns empty if a value does not fit into the type.
  std::optional<Combinations> write(SampleType type, std::span<std::byte> target) {
    Combinations combinations(highest_);
    drawn_ = {};
    const std::size_t samples = std::size_t{grid_.dims[0]} * grid_.dims[1];
    const std::size_t bytes = samples * bytes_per_sample(type);
    std::vector<Combinations::State> states;
    for (std::uint32_t slice = 0; slice < grid_.dims[2]; ++slice) {
      states.assign(samples, Combinations::kNone);
      for (auto& [label, painter] : painters_) {
        if (const auto patch = painter.slice(slice)) add(*patch, label, states, combinations);
      }
      if (!combinations.write(states, type, target.subspan(slice * bytes, bytes))) return {};
    }
    return combinations;
  }

  // Structures of which a sample was drawn.
  const std::set<std::uint32_t>& drawn() const { return drawn_; }

  // Those that go on beyond the grid.
  std::vector<std::uint32_t> cut() const {
    std::vector<std::uint32_t> labels;
    for (const auto& [label, painter] : painters_) {
      if (painter.is_cut() && drawn_.contains(label)) labels.push_back(label);
    }
    return labels;
  }

  template <class Count>
  std::size_t sum(Count count) const {
    std::size_t sum = 0;
    for (const auto& [label, painter] : painters_) sum += (painter.*count)();
    return sum;
  }

 private:
  void add(const Patch& patch, std::uint32_t label, std::span<Combinations::State> states,
           Combinations& combinations) {
    for (std::uint32_t row = 0; row < patch.mask.rows; ++row) {
      const std::size_t place = std::size_t{patch.top + row} * grid_.dims[0] + patch.left;
      for (std::uint32_t column = 0; column < patch.mask.columns; ++column) {
        if (patch.mask.samples[std::size_t{row} * patch.mask.columns + column] == 0) continue;
        drawn_.insert(label);
        states[place + column] = combinations.with(states[place + column], label);
      }
    }
  }

  const ContourGrid& grid_;
  std::uint32_t highest_ = 0;
  std::vector<std::pair<std::uint32_t, Painter>> painters_;  // by ascending label
  std::set<std::uint32_t> drawn_;
};

std::vector<LabelEntry> entries_of(const StructureSet& set, const std::set<std::uint32_t>& drawn) {
  std::vector<LabelEntry> entries;
  for (const Structure& structure : set.structures) {
    if (!drawn.contains(structure.number)) continue;
    entries.push_back(
        {.label = structure.number, .name = label_name(structure.name), .color = structure.color});
  }
  return label_table(std::move(entries));
}

// "1, 2 and 3 more".
std::string listed_labels(const std::vector<std::uint32_t>& labels) {
  constexpr std::size_t kMostNamed = 10;
  std::string text;
  const std::size_t named = std::min(labels.size(), kMostNamed);
  for (std::size_t n = 0; n < named; ++n) text += (n == 0 ? "" : ", ") + std::to_string(labels[n]);
  if (labels.size() > named) text += " and " + std::to_string(labels.size() - named) + " more";
  return text;
}

// Names stay out, because meshes carry these notes.
void add_notes(const StructureSet& set, const Drawing& drawing, const std::string& remedy,
               Volume& volume) {
  const std::vector<std::uint32_t> cut = drawing.cut();
  const std::size_t tilted = drawing.sum(&Painter::tilted);
  const std::size_t lost = set.structures.size() - drawing.drawn().size();
  std::string skipped;
  const auto add = [&](std::size_t count, const std::string& what, const std::string& why) {
    if (count > 0) skipped += (skipped.empty() ? "" : "; ") + count_of(count, what) + ' ' + why;
  };
  add(set.skipped, "contour", "not closed or with fewer than three points");
  add(tilted, "contour", "not parallel to the slices");
  add(set.empty, "structure", "without closed contours");
  add(lost, "structure", "with no sample on the grid");
  add(cut.size(), "structure",
      "where the grid ends before the contours do (" +
          std::string(cut.size() == 1 ? "label " : "labels ") + listed_labels(cut) + ')');
  if (!skipped.empty()) {
    std::string detail = "Not drawn: " + skipped + '.';
    if (tilted > 0 || lost > 0 || !cut.empty()) detail += ' ' + remedy;
    volume.notes.push_back(note_of(NoteCode::kContoursSkipped, std::move(detail)));
  }
  if (const std::size_t count = drawing.sum(&Painter::interpolated); count > 0) {
    std::string detail =
        "The shapes of structures in slices without contours were interpolated between "
        "neighbouring contours, " +
        count_of(count, "time") + '.';
    if (const std::size_t shifted = drawing.sum(&Painter::is_shifted); shifted > 0) {
      detail += " The ends of " + count_of(shifted, "structure") +
                " lie on slices, of which only the one at the lower end belongs to the structure. "
                "So its place is half a slice towards the first slice.";
    }
    volume.notes.push_back(note_of(NoteCode::kContoursInterpolated, std::move(detail)));
  }
}

Volume describe(const ContourGrid& grid, const DataSet& data) {
  Volume volume;
  volume.format = "dicom";
  volume.dims = grid.dims;
  volume.geometry = normalised(grid.geometry);
  if (const auto fault = find_fault(volume.dims, volume.geometry)) {
    throw_unusable("The grid of the DICOM structure set cannot be used: " + fault->message + '.');
  }
  volume.modality = "RTSTRUCT";
  volume.dicom = identity_of(data);
  volume.dicom->frame_of_reference_uid = frame_of_structures(data);
  volume.dicom->instances = {{utf8(data, kSopClassUid), utf8(data, kSopInstanceUid)}};
  if (!volume.dicom->series_description.empty()) volume.name = volume.dicom->series_description;
  return volume;
}

}  // namespace

Volume import_structures(const std::filesystem::path& path,
                         const std::optional<ContourGrid>& images, const ImportTask& task) {
  const DicomFile file(path, task.scratch, task.limits.max_sample_bytes);
  StructureSet set = read_structures(file.data());
  number_labels(set.structures);
  choose_structure(task.options, set);
  const ContourGrid grid = grid_of(set, images, task.options);
  Volume volume = describe(grid, file.data());
  check_limits(volume.sample_count(), SampleType::kUint8, task.limits);
  const std::string remedy = spacing_to_add(set, grid, task.options);
  Drawing drawing(set, grid);
  for (const SampleType type : drawing.types()) {
    check_limits(volume.sample_count(), type, task.limits);
    volume.type = type;
    CanonicalWriter writer(task.target, {volume.dims, type, volume.geometry});
    auto combinations = drawing.write(type, writer.samples());
    if (!combinations) continue;
    if (drawing.drawn().empty()) {
      throw_unusable("No contour of the DICOM structure set lies on the grid" +
                     std::string(task.options.spacing ? ". " : " of its images. ") + remedy);
    }
    combinations->sort_values(type, writer.samples());
    volume.labels = combinations->entries(entries_of(set, drawing.drawn()));
    if (auto note = combinations->note()) volume.notes.push_back(std::move(*note));
    add_notes(set, drawing, remedy, volume);
    return finish(writer, volume);
  }
  throw Error(ErrorCode::kInternal, "No sample type can hold the labels of a structure set.");
}

}  // namespace isomesh::import::dicom
