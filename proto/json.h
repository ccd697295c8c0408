// JSON <-> types. The only place that spells the API's field names.
//
// All functions are thread safe. Readers of responses ignore unknown members, so that an older
// client understands a newer server. Readers of requests reject them. Readers of responses fail for
// a volume or job whose id has not the form of ids (is_id), and leave it out of a list.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"

namespace isomesh {

// Omits `labels`, which only the record has.
std::string to_json(const Volume& volume);
// Omits lists of more than MeshSummary::kMostListedLabels labels: `labels_count` replaces `labels`,
// and a longer map in the parameters is empty.
std::string to_json(const Job& job);
std::string to_json(const JobParameters& parameters);
std::string to_json(const MeshParameters& parameters);
std::string to_json(const Problem& problem);
std::string to_json(const Histogram& histogram);
std::string to_json(const VolumeLabels& labels);
std::string to_json(const Estimate& estimate);
std::string to_json(const Timing& timing);
std::string to_json(const JobEvent& event);
// {"volumes": [...], "next": cursor}; `next` is null on the last page.
std::string to_json(const std::vector<Volume>& volumes, const std::string& next = "");
// {"volumes": [...]}: the response to an upload of several.
std::string to_json(const std::vector<UploadedVolume>& volumes);
// As a page of volumes, with "jobs".
std::string to_json(const std::vector<Job>& jobs, const std::string& next = "");

// As a page of volumes, with "labels".
std::string to_json(const std::vector<LabelSummary>& labels, const std::string& next);
// As a page of volumes, with "walls".
std::string to_json(const std::vector<WallSummary>& walls, const std::string& next = "");

std::string volume_name_to_json(const std::optional<std::string>& name);

// Reads a server's response. Throws Error kInternal if it does not follow the API.
Volume volume_from_json(std::string_view text);
Job job_from_json(std::string_view text);
std::vector<UploadedVolume> uploaded_volumes_from_json(std::string_view text);
Problem problem_from_json(std::string_view text);
Histogram histogram_from_json(std::string_view text);
VolumeLabels volume_labels_from_json(std::string_view text);
Estimate estimate_from_json(std::string_view text);
JobEvent job_event_from_json(std::string_view text);
std::vector<Volume> volumes_from_json(std::string_view text);
std::vector<Job> jobs_from_json(std::string_view text);
std::vector<LabelSummary> labels_from_json(std::string_view text);
std::vector<WallSummary> walls_from_json(std::string_view text);
// The cursor of the page after one of volumes, jobs or orders; empty if that is the last.
std::string next_from_json(std::string_view page);

// to_json() with its labels.
std::string to_full_json(const Volume& volume);
// to_json() without its omissions, and with the files of its labels and walls.
std::string to_full_json(const Job& job);

// A volume or a job as a store keeps it: to_full_json() with a digest (record_digest.h).
std::string to_record(const Volume& volume);
std::string to_record(const Job& job);

// Reads the text of to_record(), or of to_json() for a timing, from this version or an older one.
// Members that the older version lacked have their defaults. Throws Error kInternal, also if the
// record is not the one that its digest was made of.
Volume volume_from_record(std::string_view text);
Job job_from_record(std::string_view text);
Timing timing_from_record(std::string_view text);

// Reads the body of POST /v1/jobs. Throws Error kInvalidParameter that names every member that is
// unknown, missing, of the wrong type or out of range.
JobParameters parse_job_parameters(std::string_view body);

// Reads the body of PATCH /v1/volumes/{id}, {"name": TEXT or null}. Returns the new name; empty
// removes it. Throws as parse_job_parameters does.
std::optional<std::string> parse_volume_name(std::string_view body);

using QueryParameters =
    std::vector<std::pair<std::string, std::string>>;  // names and values, decoded

// Reads the parameters from a query, under the names of query_name_of() (parameters.h). `format`
// (several, separated by commas) stands for `formats`, `speed` for the member of `draco`. With
// kBody the request's body is the volume, and `volume` stays empty.
enum class VolumeIn { kQuery, kBody };
JobParameters parse_job_parameters(const QueryParameters& query,
                                   VolumeIn volume_in = VolumeIn::kBody);

// The inverse of VolumeIn::kQuery. Omits members that a query cannot express, such as the callback.
QueryParameters to_query(const JobParameters& parameters);

}  // namespace isomesh
