#include "proto/json.h"

#include "proto/json_values.h"

namespace isomesh {
namespace {

template <class Map>
void bound(Map& by_label) {
  if (by_label.size() > MeshSummary::kMostListedLabels) by_label.clear();
}

bool is_long(const Job& job) {
  constexpr std::size_t kMost = MeshSummary::kMostListedLabels;
  const JobParameters& asked = job.parameters;
  return (job.mesh && job.mesh->labels.size() > kMost) || asked.label_names.size() > kMost ||
         asked.label_colors.size() > kMost || asked.label_values.size() > kMost;
}

// Responses omit long lists of labels; a route of their own pages through them.
Job bounded(Job job) {
  bound(job.parameters.label_names);
  bound(job.parameters.label_colors);
  bound(job.parameters.label_values);
  if (job.mesh && job.mesh->labels.size() > MeshSummary::kMostListedLabels) {
    job.mesh->labels_count = job.mesh->labels.size();
    job.mesh->labels.clear();
  }
  return job;
}

}  // namespace

using json_values::from_record;
using json_values::from_text;
using json_values::full_text;
using json_values::object;
using json_values::page;
using json_values::record_of;
using json_values::to_text;

std::string to_json(const Volume& volume) { return to_text(volume); }
std::string to_json(const JobParameters& parameters) { return to_text(parameters); }
std::string to_json(const MeshParameters& parameters) { return to_text(parameters); }
std::string to_json(const Problem& problem) { return to_text(problem); }
std::string to_json(const Histogram& histogram) { return to_text(histogram); }
std::string to_json(const VolumeLabels& labels) { return to_text(labels); }
std::string to_json(const Estimate& estimate) { return to_text(estimate); }
std::string to_json(const Timing& timing) { return to_text(timing); }
std::string to_json(const JobEvent& event) { return to_text(event); }

std::string to_json(const std::vector<Volume>& volumes, const std::string& next) {
  return page("volumes", volumes, next);
}

std::string to_json(const std::vector<UploadedVolume>& volumes) {
  return object("volumes", volumes);
}

std::string to_json(const std::vector<Job>& jobs, const std::string& next) {
  return page("jobs", jobs, next);
}

std::string volume_name_to_json(const std::optional<std::string>& name) {
  return object("name", name);
}

std::string to_json(const Job& job) { return is_long(job) ? to_text(bounded(job)) : to_text(job); }

std::string to_json(const std::vector<LabelSummary>& labels, const std::string& next) {
  return page("labels", labels, next);
}

std::string to_json(const std::vector<WallSummary>& walls, const std::string& next) {
  return page("walls", walls, next);
}

std::string to_full_json(const Volume& volume) { return full_text(volume); }
std::string to_full_json(const Job& job) { return full_text(job); }

std::string to_record(const Volume& volume) { return record_of(volume); }
std::string to_record(const Job& job) { return record_of(job); }

Volume volume_from_record(std::string_view text) { return from_record<Volume>(text); }
Job job_from_record(std::string_view text) { return from_record<Job>(text); }
Timing timing_from_record(std::string_view text) { return from_record<Timing>(text); }

Volume volume_from_json(std::string_view text) { return from_text<Volume>(text); }
Job job_from_json(std::string_view text) { return from_text<Job>(text); }
std::vector<UploadedVolume> uploaded_volumes_from_json(std::string_view text) {
  return from_text<std::vector<UploadedVolume>>(text, "volumes");
}
Problem problem_from_json(std::string_view text) { return from_text<Problem>(text); }
Histogram histogram_from_json(std::string_view text) { return from_text<Histogram>(text); }
VolumeLabels volume_labels_from_json(std::string_view text) {
  return from_text<VolumeLabels>(text);
}
Estimate estimate_from_json(std::string_view text) { return from_text<Estimate>(text); }
JobEvent job_event_from_json(std::string_view text) { return from_text<JobEvent>(text); }

std::vector<Volume> volumes_from_json(std::string_view text) {
  return from_text<std::vector<Volume>>(text, "volumes");
}

std::vector<LabelSummary> labels_from_json(std::string_view text) {
  return from_text<std::vector<LabelSummary>>(text, "labels");
}

std::vector<WallSummary> walls_from_json(std::string_view text) {
  return from_text<std::vector<WallSummary>>(text, "walls");
}

std::vector<Job> jobs_from_json(std::string_view text) {
  return from_text<std::vector<Job>>(text, "jobs");
}

std::string next_from_json(std::string_view page) {
  const JsonTree tree(page);
  const Json* const next = json_values::find(tree.root(), "next");
  return next != nullptr && json_values::is_string(*next) ? json_values::text(*next) : "";
}

}  // namespace isomesh
