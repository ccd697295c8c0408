// The labels of a finished job, read in pages. A job with few labels has them in its record. A job
// with more has them in a file beside its mesh: JSON pages, each with up to
// MeshSummary::kMostListedLabels labels in ascending order, followed by an index. The index has one
// entry per page: its first label and the offset of its first byte, each as a little-endian 64-bit
// number.
//
// Its walls are in a file, too: for each one four such numbers, the places of its two labels among
// the job's (from 1 on; 0 for the background), the bits of its area and its number of faces. Those
// of labels that share faces come first, so that a list of them reads no others. Both ascend by the
// two places. In files of older servers they ascend together, and those of jobs without
// MeshSummary::edge_contacts_count lack the number of faces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "proto/types.h"
#include "server/codec/encode.h"
#include "server/mesh/labels/label_surface.h"
#include "server/store/blob_store.h"

namespace isomesh::jobs {

// Writes the file of a job's labels. `labels` must be ascending.
void write_label_pages(std::span<const LabelSummary> labels, const codec::Sink& sink);

// Reads the labels of a job that has a mesh. The job must outlive this object. Not thread safe. All
// methods but count() throw Error kInternal if the file is damaged.
class JobLabels {
 public:
  // Reads the index. Throws Error kNotFound if the file is missing, kInternal if it is damaged.
  JobLabels(const Job& job, const store::BlobStore& blobs);

  // Zero for a job at an iso-value.
  std::uint64_t count() const { return count_; }

  // The labels after `label`, or from the first one, in ascending order: between one and
  // MeshSummary::kMostListedLabels; none at the end of the list. Their files have addresses.
  std::vector<LabelSummary> after(std::optional<std::int64_t> label) const;

  // True if more labels follow the last one that after() returned. Reads nothing.
  bool has_after(std::int64_t last) const;

  // Calls `visit` for each label, ascending, and reads each page once. Their files may have no
  // addresses.
  void for_each(const std::function<void(const LabelSummary& label)>& visit) const;

  // The labels at those places in the list, from 1 to count(). Reads no page twice.
  std::map<std::uint64_t, LabelSummary> at(const std::set<std::uint64_t>& places) const;

  // Empty if the job has no such label. Its files may have no addresses.
  std::optional<LabelSummary> find(std::int64_t label) const;

 private:
  struct Page {
    std::int64_t first = 0;
    std::uint64_t offset = 0;
  };

  void read_index(const LabelListFile& file);
  std::vector<LabelSummary> page(std::size_t n) const;
  // The page that contains the label if the job has it.
  std::size_t page_of(std::int64_t label) const;

  const Job& job_;
  std::uint64_t count_ = 0;
  std::unique_ptr<store::BlobReader> file_;  // null if the record has the labels
  std::vector<Page> pages_;
  std::uint64_t end_of_pages_ = 0;
};

// Writes the file of a job's walls, which ascend.
void write_walls(std::span<const mesh::WallArea> walls, const codec::Sink& sink);

struct WallPage {
  std::vector<WallSummary> walls;
  std::optional<std::uint64_t> next;  // where the next page begins, if there is one
};

// The walls from place `begin` of the file on, at most MeshSummary::kMostListedLabels; those of
// labels that share no face of a voxel only if `edge_contacts` is true. The job must have a mesh.
// Throws Error kNotFound if it was made before walls were measured, and as JobLabels does.
WallPage walls_of(const Job& job, std::uint64_t begin, bool edge_contacts,
                  const store::BlobStore& blobs);

// The materials of the job's OBJ, in the form of its file kMaterialsName; empty for a job at an
// iso-value. Throws as JobLabels does.
std::string materials_of(const JobLabels& labels);

}  // namespace isomesh::jobs
