#include "server/import/formats/nifti_forms.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <optional>
#include <string>

#include "base/text.h"
#include "server/import/formats/placing.h"

namespace isomesh::import {
namespace {

double millimetres_per_unit(const NiftiHeader& header) {
  constexpr int kSpatialUnits = 7;
  switch (header.units & kSpatialUnits) {
    case 1:
      return 1000;
    case 3:
      return 0.001;
    default:
      return 1;
  }
}

bool is_length(double size) { return std::isfinite(size) && size > 0; }

// An axis with a single sample needs no spacing, and some programs write 0. Negative sizes stand
// for their amount, and 0 for 1 mm, as in nibabel; a note tells that.
Vector3 spacing_of(const NiftiHeader& header, SourceVolume& volume) {
  Vector3 spacing;
  std::string corrections;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double said = header.pixdim[axis + 1];
    spacing[axis] = said == 0 ? 1 : std::abs(said);
    if (volume.dims[axis] == 1 && !(said > 0)) {
      spacing[axis] = 1;
    } else if (!is_length(spacing[axis])) {
      throw_unusable("The voxel size along " + axis_name(axis) + " is " + to_text(said) +
                     ", not a positive number.");
    } else if (spacing[axis] != said) {
      corrections += (corrections.empty() ? "" : " ") +
                     ("The voxel size along " + axis_name(axis)) + " is " + to_text(said) +
                     " and was read as " + to_text(spacing[axis]) +
                     (said < 0 ? ". Some programs mirror the axis instead." : ".");
    }
  }
  if (!corrections.empty()) volume.notes.push_back(corrected_note(corrections));
  return spacing;
}

// Origin and steps in RAS and in the file's unit.
struct Placement {
  Vector3 origin = {};
  std::array<Vector3, 3> steps = {};
};

Placement sform_of(const NiftiHeader& header) {
  Placement placement;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      placement.steps[axis][row] = header.srow[row * 4 + axis];
    }
    placement.origin[row] = header.srow[row * 4 + 3];
  }
  return placement;
}

double squares_of(const NiftiHeader& header) {
  const auto& [b, c, d] = header.quaternion;
  return b * b + c * c + d * d;
}

bool is_rotation(const NiftiHeader& header) {
  constexpr double kRounding = 1e-3;
  return squares_of(header) <= 1 + kRounding;
}

// The quaternion has length 1 and a nonnegative real part, which is therefore not stored. Near half
// a turn, the rounding of the others is all that is left of its square, so it is 0 then, as in the
// C library of NIfTI.
Placement qform_of(const NiftiHeader& header, const Vector3& spacing) {
  constexpr double kRounding = 1e-7;
  if (!is_rotation(header)) {
    throw_unusable("The quaternion of the NIfTI header's qform is not a rotation.");
  }
  auto [b, c, d] = header.quaternion;
  const double squares = squares_of(header);
  const bool is_half_turn = 1 - squares < kRounding;
  const double a = is_half_turn ? 0 : std::sqrt(1 - squares);
  const double norm = is_half_turn ? std::sqrt(squares) : 1;
  b /= norm;
  c /= norm;
  d /= norm;
  const double last = header.pixdim[0] < 0 ? -spacing[2] : spacing[2];
  Placement placement;
  placement.origin = header.qoffset;
  placement.steps[0] = {(a * a + b * b - c * c - d * d) * spacing[0],
                        2 * (b * c + a * d) * spacing[0], 2 * (b * d - a * c) * spacing[0]};
  placement.steps[1] = {2 * (b * c - a * d) * spacing[1],
                        (a * a + c * c - b * b - d * d) * spacing[1],
                        2 * (c * d + a * b) * spacing[1]};
  placement.steps[2] = {2 * (b * d + a * c) * last, 2 * (c * d - a * b) * last,
                        (a * a + d * d - b * b - c * c) * last};
  return placement;
}

Vector3 point_of(const Placement& placement, const std::array<double, 3>& index) {
  Vector3 point = placement.origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t row = 0; row < 3; ++row) {
      point[row] += placement.steps[axis][row] * index[axis];
    }
  }
  return point;
}

// The largest distance between the two positions of a sample, which is at a corner.
double distance_of(const Placement& one, const Placement& other,
                   const std::array<std::uint32_t, 3>& dims) {
  double most = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    std::array<double, 3> index;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      index[axis] = (corner >> axis & 1U) != 0 ? dims[axis] - 1.0 : 0;
    }
    const Vector3 a = point_of(one, index);
    const Vector3 b = point_of(other, index);
    most = std::max(most, std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]));
  }
  return most;
}

double shortest_step(const Placement& placement) {
  double shortest = HUGE_VAL;
  for (const Vector3& step : placement.steps) {
    shortest = std::min(shortest, std::hypot(step[0], step[1], step[2]));
  }
  return shortest;
}

void note_other_pixdim(const NiftiHeader& header, const Placement& sform, SourceVolume& volume) {
  constexpr double kTolerance = 0.01;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Vector3& step = sform.steps[axis];
    const double size = std::hypot(step[0], step[1], step[2]);
    const double told = header.pixdim[axis + 1];
    const bool agrees = is_length(told) && std::abs(size - told) <= told * kTolerance;
    if (volume.dims[axis] == 1 || agrees) continue;
    volume.notes.push_back(
        note_of(NoteCode::kPixdimDiffers, "The NIfTI header gives two sizes for a voxel along " +
                                              axis_name(axis) + ": " + to_text(told) +
                                              " in its pixdim and " + to_text(size) +
                                              " in its sform. The sform was used."));
    return;
  }
}

Placement without_forms(const Vector3& spacing, SourceVolume& volume) {
  volume.notes.push_back(
      note_of(NoteCode::kSpaceAssumed,
              "The NIfTI header has neither an sform nor a qform (both codes are 0). The axes were "
              "read as those of LPS, with the first sample at (0,0,0)."));
  Placement placement;
  // The LPS axes, in RAS.
  placement.steps[0][0] = -spacing[0];
  placement.steps[1][1] = -spacing[1];
  placement.steps[2][2] = spacing[2];
  return placement;
}

// Many writers leave the field at 0 or at random, so nibabel and SPM ignore it, too.
std::string ignored_orient(int orient) {
  static constexpr const char* kNames[] = {"",
                                           "coronal unflipped",
                                           "sagittal unflipped",
                                           "transverse flipped",
                                           "coronal flipped",
                                           "sagittal flipped"};
  if (orient < 1 || orient >= static_cast<int>(std::size(kNames))) return {};
  return " Its field \"orient\", " + std::to_string(orient) + " (" + kNames[orient] +
         "), was ignored because many programs do not set it correctly.";
}

// SPM's field of an Analyze header: the sample at (0,0,0). Other programs write text there or
// leave it empty. As in nibabel, it counts if it is near the volume.
std::optional<Vector3> spm_origin(const NiftiHeader& header, const SourceVolume& volume) {
  Vector3 sample;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t origin = header.spm_origin[axis];
    const std::int64_t size = volume.dims[axis];
    if (origin <= -size || origin >= 2 * size) return std::nullopt;
    sample[axis] = static_cast<double>(origin) - 1;
  }
  if (header.spm_origin == std::array<std::int64_t, 3>{}) return std::nullopt;
  return sample;
}

// Analyze's axes run left, front and up, and its images are centred unless SPM tells where they
// are, as programs that read them assume.
Placement analyze_placement(const NiftiHeader& header, const Vector3& spacing,
                            SourceVolume& volume) {
  const auto origin = spm_origin(header, volume);
  volume.notes.push_back(note_of(
      NoteCode::kSpaceAssumed,
      std::string("An Analyze header does not say how its axes lie in the patient. The axes "
                  "were assumed to run to the left, to the front and up, with (0,0,0) ") +
          (origin ? "where SPM's field \"originator\" has it." : "in the middle.") +
          ignored_orient(header.analyze_orient)));
  Placement placement;
  placement.steps[0][0] = -spacing[0];
  placement.steps[1][1] = spacing[1];
  placement.steps[2][2] = spacing[2];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double sample = origin ? (*origin)[axis] : (volume.dims[axis] - 1.0) / 2;
    placement.origin[axis] = -placement.steps[axis][axis] * sample;
  }
  return placement;
}

void note_other_form(const NiftiHeader& header, const Placement& taken, const Placement& other,
                     const std::string& name_of_taken, SourceVolume& volume) {
  constexpr double kVoxels = 0.01;
  const std::string name_of_other = name_of_taken == "sform" ? "qform" : "sform";
  const double apart = distance_of(taken, other, volume.dims);
  if (apart <= shortest_step(taken) * kVoxels) return;
  std::array<char, 32> millimetres = {};
  std::snprintf(millimetres.data(), millimetres.size(), "%.1f",
                apart * millimetres_per_unit(header));
  volume.notes.push_back(
      note_of(NoteCode::kFormsDiffer, std::string("The sform and qform of the NIfTI header place "
                                                  "samples up to ") +
                                          millimetres.data() + " mm apart. The " + name_of_taken +
                                          " was used. nifti_form=" + name_of_other +
                                          " selects the " + name_of_other + "."));
}

// False if an axis has no length, as that of a form that was never set.
bool is_usable(const Placement& placement) {
  return std::ranges::all_of(placement.steps, [](const Vector3& step) {
    return is_length(std::hypot(step[0], step[1], step[2]));
  });
}

[[noreturn]] void throw_bad_sform() {
  throw_choice(
      "The sform of the NIfTI header gives no direction for an axis, although its code says that "
      "it "
      "holds. The header also has a qform. Choose it with nifti_form=qform.",
      {{"nifti_form", "qform", "the qform of the header"}});
}

Placement placement_of(const NiftiHeader& header, const ImportOptions& options,
                       SourceVolume& volume) {
  const bool has_sform = header.sform_code > 0;
  const bool has_qform = header.qform_code > 0;
  const auto asked = options.nifti_form;
  if (asked && !(*asked == NiftiForm::kSform ? has_sform : has_qform)) {
    throw_unusable("The NIfTI header has no " + std::string(to_string(*asked)) +
                   ", which nifti_form selects.");
  }
  const bool takes_sform = asked ? *asked == NiftiForm::kSform : has_sform;
  const bool has_sizes =
      std::all_of(header.pixdim.begin() + 1, header.pixdim.begin() + 4, is_length);
  if (!takes_sform) {
    const Vector3 spacing = spacing_of(header, volume);
    if (header.is_analyze) return analyze_placement(header, spacing, volume);
    if (!has_qform) return without_forms(spacing, volume);
    const Placement qform = qform_of(header, spacing);
    const Placement sform = sform_of(header);
    if (has_sform && is_usable(sform)) note_other_form(header, qform, sform, "qform", volume);
    return qform;
  }
  const Placement sform = sform_of(header);
  if (has_qform && is_rotation(header) && !is_usable(sform)) throw_bad_sform();
  note_other_pixdim(header, sform, volume);
  if (has_qform && has_sizes && is_rotation(header)) {
    note_other_form(header, sform, qform_of(header, spacing_of(header, volume)), "sform", volume);
  }
  return sform;
}

}  // namespace

Note corrected_note(const std::string& corrections) {
  return note_of(
      NoteCode::kHeaderCorrected,
      "The NIfTI header has fields that mean nothing or contradict others. " + corrections);
}

Geometry nifti_geometry(const NiftiHeader& header, const ImportOptions& options,
                        SourceVolume& volume) {
  auto [origin, steps] = placement_of(header, options, volume);
  const double scale = millimetres_per_unit(header);
  for (Vector3* vector : {&origin, &steps[0], &steps[1], &steps[2]}) {
    for (double& part : *vector) part *= scale;
  }
  return geometry_of_ras(origin, steps);
}

}  // namespace isomesh::import
