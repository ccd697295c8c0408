// What a person needs to tell the series of an upload apart.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "proto/error.h"
#include "server/import/dicom/choosing/series.h"

namespace isomesh::import::dicom {

// Returns the error with the patient, study, date and a small picture of each series that it
// offers, as far as they are known. Only the first series have pictures.
Error with_series_facts(const Error& error, std::span<const Source> sources,
                        const std::filesystem::path& scratch, std::uint64_t most_sample_bytes);

}  // namespace isomesh::import::dicom
