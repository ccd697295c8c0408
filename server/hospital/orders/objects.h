// A finished job's meshes as DICOM objects.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "proto/orders.h"
#include "proto/types.h"
#include "server/store/blob_store.h"
#include "server/store/order_store.h"

namespace isomesh::orders {

// An object that lies in the store of blobs.
struct MadeObject {
  std::optional<std::int64_t> label;
  std::string series_uid;
  std::string sop_instance_uid;
  store::Blob blob;
};

// The most objects of an order, over all PACS that they are sent to: they are listed in its record
// and in its JSON.
inline constexpr std::size_t kMostObjects = 500;

// Makes an object of each of the job's STL files: of the only one, or of each label's. Their UIDs
// follow from what they are, so that objects of the same images with the same mesh have the same,
// whoever makes them when. The blobs are not settled (BlobStore::settle). Throws Error
// kUnusableVolume for an empty surface, kTooLarge when one has more than `most_bytes`, kOutOfSpace.
std::vector<MadeObject> make_objects(const store::OrderRecord& record, const Job& job,
                                     const std::string& station_name, std::uint64_t most_bytes,
                                     std::chrono::system_clock::time_point made,
                                     const store::BlobStore& blobs);

// Why a mesh without triangles has none, of samples in that range: kUnusableVolume.
Error empty_surface(const MeshSummary& mesh, const std::array<double, 2>& range);

// How many triangles the job's mesh may have for no object to have more than `most_bytes`; empty
// when none has. Throws Error kTooLarge when not even one triangle fits.
std::optional<std::uint32_t> triangles_that_fit(const store::OrderRecord& record, const Job& job,
                                                const std::string& station_name,
                                                std::uint64_t most_bytes,
                                                const store::BlobStore& blobs);

// Whether the files that objects are made of are there as they were written.
bool can_make_objects(const Job& job, const store::BlobStore& blobs);

}  // namespace isomesh::orders
