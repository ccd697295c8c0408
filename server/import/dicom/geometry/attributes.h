// Where the attributes of a frame stand, and what they say of its place, its values and its volume.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// The places where a frame's attributes may be: its own functional groups, the shared ones, and the
// object itself.
class Attributes {
 public:
  // `data` must outlive the attributes.
  Attributes(const DataSet& data, std::uint32_t frame);

  // The group for the frame, its own or the shared one; null when there is neither.
  const DataSet* group(Tag sequence) const;

  // The data set in which an attribute of a group is looked for.
  const DataSet& place(Tag sequence) const;

 private:
  const DataSet& data_;
  const DataSet* shared_ = nullptr;
  const DataSet* own_ = nullptr;
};

// True for an object that describes its frames in functional groups.
bool has_functional_groups(const DataSet& data);

// Throws Error kUnusableVolume when the object does not tell where the frame lies.
Plane plane_of(const Attributes& attributes);

// The numbers of a unit vector. Throws Error kUnusableVolume when they are of another length.
Vector3 unit_vector(const double* parts);

// The numbers of an element. Throws Error kUnusableVolume, calling it `name`, when they are not as
// many as `count`.
std::vector<double> required_numbers(const DataSet& data, Tag tag, std::size_t count,
                                     std::string_view name);

// Slope 1 and intercept 0 where the frame tells neither, and for the one that it does not tell.
// Throws Error kUnusableVolume.
Rescale rescale_of(const DataSet& data);

// The names, by PS3.6, of the attributes in which frames at one position may differ.
std::span<const std::string_view> phase_names();

// The values of those attributes that hold for the whole object, and those of one frame alone. Only
// the ones that are told, in the order of phase_names().
std::vector<Phase> phases_of_object(const DataSet& data);
std::vector<Phase> phases_of_frame(const DataSet& data, std::uint32_t frame);

}  // namespace isomesh::import::dicom
