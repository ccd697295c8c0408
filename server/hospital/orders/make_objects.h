// Makes DICOM objects from a finished job's meshes.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "base/error.h"
#include "proto/types.h"
#include "server/hospital/orders/label_grid.h"
#include "server/hospital/protocol/orders.h"
#include "server/hospital/records/order_store.h"
#include "server/store/blob_store.h"

namespace isomesh::orders {

struct MadeObject {
  SendFormat format = SendFormat::kStl;  // of the targets that it is for
  std::optional<std::int64_t> label;
  std::string sop_class_uid;
  std::string series_uid;
  std::string sop_instance_uid;
  store::Blob blob;
};

// Limit of objects of an order, over all PACS they are sent to: its record and its JSON list them.
inline constexpr std::size_t kMostObjects = 500;

struct Making {
  std::string station_name;
  std::uint64_t most_bytes = 0;  // of an object
  std::chrono::system_clock::time_point made;
  std::stop_token stop;
  std::optional<LabelGrid> labels = {};  // of an order with a label volume
};

// The content description of a job's objects: its iso-value with the side that is inside, and how
// the surface was made. At most 64 characters, the limit of LO. The job has a mesh.
std::string description_of(const Job& job);

// Makes the objects of all formats that the order sends. STL: one, or one for each label. OBJ: one
// of all labels, after the object of their materials. SR: one report on all surfaces. SEG: one
// segmentation with the samples of all labels that have a surface. UIDs are
// derived from the content, so the same images with the same mesh always have the same UIDs.
// `stored` gets the keys of the blobs, which no record names yet, also if it throws. Throws Error
// kEmptySurface, kTooLarge if an object exceeds `most_bytes`, kCancelled, and as BlobWriter.
std::vector<MadeObject> make_objects(const store::OrderRecord& record, const Job& job,
                                     const Making& making, store::BlobStore& blobs,
                                     std::vector<std::string>& stored);

// The number of triangles with which no mesh exceeds `most_bytes`; empty if none does. Throws Error
// kTooLarge if not even one triangle fits.
std::optional<std::uint32_t> triangles_that_fit(const store::OrderRecord& record, const Job& job,
                                                const Making& making,
                                                const store::BlobStore& blobs);

// True if the blobs of the files from which objects are made are intact.
bool can_make_objects(const Job& job, const store::BlobStore& blobs, const std::stop_token& stop);

}  // namespace isomesh::orders
