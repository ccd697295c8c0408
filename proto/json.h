// JSON <-> types. The only place that spells the API's field names.
//
// All functions are thread safe. Reading an answer ignores members that this version does not know,
// so that an older client understands a newer server; reading a request refuses them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"

namespace isomesh {

// Without what only its owner's record has, its labels.
std::string to_json(const Volume& volume);
// Without lists of more than MeshSummary::kMostListedLabels labels: `labels_count` replaces
// `labels`, and a longer map of the parameters is empty.
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
// {"volumes": [...]}: the answer to an upload of several.
std::string to_json(const std::vector<UploadedVolume>& volumes);
// As a page of volumes, with "jobs".
std::string to_json(const std::vector<Job>& jobs, const std::string& next = "");

// As a page of volumes, with "labels".
std::string to_json(const std::vector<LabelSummary>& labels, const std::string& next);

// The body of PATCH /v1/volumes/{id}.
std::string volume_name_to_json(const std::optional<std::string>& name);

// Reads an answer of the server. Throws Error kInternal when it is not what the API says.
Volume volume_from_json(std::string_view text);
Job job_from_json(std::string_view text);
std::vector<UploadedVolume> uploaded_volumes_from_json(std::string_view text);
std::vector<Note> notes_from_json(std::string_view text);
Problem problem_from_json(std::string_view text);
Histogram histogram_from_json(std::string_view text);
VolumeLabels volume_labels_from_json(std::string_view text);
Estimate estimate_from_json(std::string_view text);
JobEvent job_event_from_json(std::string_view text);
std::vector<Volume> volumes_from_json(std::string_view text);
std::vector<Job> jobs_from_json(std::string_view text);
std::vector<LabelSummary> labels_from_json(std::string_view text);

// A volume as a store keeps it and as an import tells it: to_json() with its labels.
std::string to_record(const Volume& volume);
// A job as a store keeps it: whole, with the file of its labels.
std::string to_record(const Job& job);

// Reads what to_record(), or to_json() of a timing, made in this version or an older
// one: members that it did not know yet have their defaults. Throws Error kInternal.
Volume volume_from_record(std::string_view text);
Job job_from_record(std::string_view text);
Timing timing_from_record(std::string_view text);

// Reads the body of POST /v1/jobs. Throws Error kInvalidParameter that names every member which is
// unknown, missing, of the wrong type or out of range.
JobParameters parse_job_parameters(std::string_view body);

// Reads the body of PATCH /v1/volumes/{id}, {"name": TEXT or null}: the name that the volume is to
// have, empty for none. Throws as parse_job_parameters does.
std::optional<std::string> parse_volume_name(std::string_view body);

using QueryParameters =
    std::vector<std::pair<std::string, std::string>>;  // names and values, decoded

// The same from a query, where everything is text and parameters go by query_name_of()
// (parameters.h): `format` (several, separated by commas) stands for `formats`, `speed` for the
// member of `draco`. The volume is a parameter of its own, or the request's body and then stays
// empty here.
enum class VolumeIn { kQuery, kBody };
JobParameters parse_job_parameters(const QueryParameters& query,
                                   VolumeIn volume_in = VolumeIn::kBody);

// The inverse of VolumeIn::kQuery. What a query cannot say, such as the callback, is left out.
QueryParameters to_query(const JobParameters& parameters);

}  // namespace isomesh
