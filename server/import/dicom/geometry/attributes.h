// Reads a frame's attributes: its geometry, its rescale, and the attributes that distinguish
// volumes.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// The data sets with a frame's attributes: its own functional groups, the shared ones, and the
// object.
class Attributes {
 public:
  // `data` must outlive the attributes.
  Attributes(const DataSet& data, std::uint32_t frame);

  // All items of the frame's own or shared group; empty if there is neither.
  std::span<const DataSet> items(Tag sequence) const;

  // The first of them; null if there is none.
  const DataSet* group(Tag sequence) const;

  // The data set that holds the attributes of a group.
  const DataSet& place(Tag sequence) const;

 private:
  const DataSet& data_;
  const DataSet* shared_ = nullptr;
  const DataSet* own_ = nullptr;
};

// True for an object that describes its frames in functional groups.
bool has_functional_groups(const DataSet& data);

// Throws Error kUnusableVolume if the object does not define the frame's position.
Plane plane_of(const Attributes& attributes);

// The same without a position, for objects that define it elsewhere: the position is 0.
Plane placeless_plane_of(const Attributes& attributes);

// The plane of these cosines (of a row, then of a column) and distances (between rows, then between
// columns), at the position 0. Throws Error kUnusableVolume.
Plane plane_of(const std::vector<double>& cosines, const std::vector<double>& spacing);

// True if the frame's position is in the space of an ultrasound volume (PS3.3, A.59).
bool is_in_volume_space(const Attributes& attributes);

// Returns a unit vector. Throws Error kUnusableVolume if its length is not 1.
Vector3 unit_vector(const double* parts);

// The numbers of an element. Throws Error kUnusableVolume, with `name`, unless there are `count`.
std::vector<double> required_numbers(const DataSet& data, Tag tag, std::size_t count,
                                     std::string_view name);

// Sets the frame's rescale to that of `data`. Missing slopes are 1, missing intercepts 0. Throws
// Error kUnusableVolume.
void set_rescale(const DataSet& data, Frame& frame);

// The names (PS3.6) of the attributes in which frames at one position may differ.
std::span<const std::string_view> phase_names();

// The index of a name in phase_names(), which must be there.
std::size_t phase_attribute(std::string_view name);

// True if the attribute is a step of a protocol, such as an echo, and not only a time or number by
// which a slice that was taken twice differs from its copy.
bool is_planned(std::string_view phase_name);

// True if all slices of a volume have one value of it, wherever they lie.
bool is_of_volumes(std::string_view phase_name);

// The values of those attributes for the whole object, and for one frame alone. Missing ones are
// omitted; the order is that of phase_names().
std::vector<Phase> phases_of_object(const DataSet& data);
std::vector<Phase> phases_of_frame(const DataSet& data, std::uint32_t frame);

}  // namespace isomesh::import::dicom
