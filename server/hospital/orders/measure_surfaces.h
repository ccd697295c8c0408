// Measures a finished job's surfaces for a report.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/types.h"
#include "server/hospital/objects/measurement_report.h"
#include "server/store/blob_store.h"

namespace isomesh::orders {

// Limit of labels in a report: most viewers show all of them in one list.
inline constexpr std::size_t kMostReportedLabels = 1000;

// The segment of a label; empty if the images tell none.
std::optional<DicomSegment> find_segment(const DicomIdentity& identity, std::int64_t label);

// The surface of a job at an iso-value, which gets the name `title`, or each label's surface. The
// largest diameter is measured at the vertices of the job's STL files. Throws Error kTooLarge if
// there are too many labels, kCancelled, and as BlobStore::open and jobs::JobLabels do.
std::vector<dicom::MeasuredSurface> measure_surfaces(const Job& job, const DicomIdentity& identity,
                                                     const std::string& title,
                                                     const store::BlobStore& blobs,
                                                     const std::stop_token& stop);

// The measurements as one text, which is the same for the same measurements only.
std::string text_of(const std::vector<dicom::MeasuredSurface>& surfaces);

}  // namespace isomesh::orders
