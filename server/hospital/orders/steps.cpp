#include "server/hospital/orders/steps.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include "base/clock.h"
#include "base/sha256.h"
#include "proto/error.h"
#include "proto/json.h"
#include "server/hospital/orders/make_objects.h"
#include "server/hospital/orders/received.h"
#include "server/hospital/orders/step_records.h"
#include "server/jobs/library/complete_labels.h"

namespace isomesh::orders {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using store::Time;

// After this many queries without a result the series is given up.
constexpr std::uint32_t kMostLooks = 4;
// Jobs report their end at once; this detects a lost report.
constexpr seconds kJobLook{30};

// An order that is restarted or fetches its images again gets a new job, even if the volume is the
// same.
std::string job_key(const store::OrderRecord& record) {
  constexpr std::size_t kEnough = 12;
  const std::string what =
      sha256_of(record.order.volume.value_or("") + ' ' + record.work.begun + ' ' +
                std::to_string(record.order.attempts) +
                (record.work.triangles ? ' ' + std::to_string(*record.work.triangles) : ""))
          .substr(0, kEnough);
  return "order-" + record.order.id + '-' + what;
}

// Limits the parameters so that the mesh fits into its object.
void simplify(const OrderWork& work, JobParameters& parameters) {
  parameters.triangles = std::min(*work.triangles, parameters.triangles.value_or(*work.triangles));
  parameters.max_error_mm =
      std::min(*work.max_error_mm, parameters.max_error_mm.value_or(*work.max_error_mm));
  parameters.certify = true;
}

// An OBJ has all labels, and its materials are a second object. So has a report.
void check_count_of_objects(const Order& order, const Job& job) {
  constexpr std::uint64_t kAtMost = 2;
  const std::uint64_t labels = job.mesh ? job.mesh->labels_count.value_or(1) : 0;
  std::uint64_t objects = 0;
  for (const SendTarget& target : order.send) {
    objects += target.format == SendFormat::kStl ? labels : kAtMost;
  }
  if (objects <= kMostObjects) return;
  throw Error(ErrorCode::kTooLarge,
              "the mesh has " + std::to_string(labels) + " labels for " +
                  std::to_string(order.send.size()) +
                  " PACS, each an object of its own, but an order makes at most " +
                  std::to_string(kMostObjects) +
                  " objects; order fewer labels, or send them as obj");
}

bool is_reported(const Order& order) {
  return std::ranges::find(order.send, SendFormat::kSr, &SendTarget::format) != order.send.end();
}

bool has_bytes(const std::filesystem::path& file) {
  std::error_code missing;
  const std::uintmax_t bytes = std::filesystem::file_size(file, missing);
  return !missing && bytes > 0;
}

}  // namespace

std::string OrderSteps::pacs_of(const store::OrderRecord& record) {
  const auto& workitem = record.work.workitem;
  if (workitem &&
      (workitem->ending || !workitem->claimed || record.order.state == OrderState::kMeshing)) {
    return workitem->worklist;
  }
  switch (record.order.state) {
    case OrderState::kWaiting:
    case OrderState::kFetching:
      return record.order.source.pacs;
    case OrderState::kSending:
      for (const OrderResult& result : record.order.results) {
        if (!result.stored) return result.pacs;
      }
      return "";
    default:
      return "";
  }
}

Time OrderSteps::advance(store::OrderRecord& record, const std::stop_token& stop,
                         std::vector<std::string>& stored) const {
  if (const auto& workitem = record.work.workitem; workitem && !is_final(record.order.state)) {
    if (workitem->ending) return tell_end(record, stop);
    if (!workitem->claimed) return claim(record, stop);
    if (!tell(record, stop)) return now_();
  }
  switch (record.order.state) {
    case OrderState::kWaiting:
      return wait_for_series(record, stop);
    case OrderState::kFetching:
      return fetch(record, stop);
    case OrderState::kMeshing:
      return mesh(record, stop, stored);
    case OrderState::kSending:
      return send(record, stop);
    default:
      throw OrderIsOver();
  }
}

const Peer& OrderSteps::peer(const std::string& name) const {
  const auto found = services_.peers.find(name);
  if (found != services_.peers.end()) return found->second;
  throw PacsFailure(PacsFault::kUnreachable, "the PACS is no longer configured");
}

SeriesSource& OrderSteps::source(const std::string& name) const {
  if (const auto& source = peer(name).source) return *source;
  throw PacsFailure(PacsFault::kRefused,
                    "meshes can only be sent to this PACS: it has no dicomweb");
}

std::optional<bool> OrderSteps::has_instance(const std::string& pacs, const InstancePlace& place,
                                             const std::stop_token& stop) const {
  const auto& archive = peer(pacs).archive;
  if (!archive) return std::nullopt;
  return archive->has_instance(place, stop);
}

Time OrderSteps::save(store::OrderRecord& record, Time next) const {
  next = std::min(next, now_() + store::kLongestWait);
  record.order.next_attempt.reset();
  if (!services_.orders.save(record, next)) throw OrderIsOver();
  return next;
}

// Forgets failures only if they were in `step` or before. Otherwise a series that can be listed but
// not fetched would be fetched repeatedly without a pause.
Time OrderSteps::save_after(OrderState step, store::OrderRecord& record, Time next) const {
  if (record.work.failed_in <= step) {
    record.order.error.reset();
    record.work.failures = 0;
    record.work.failed_in.reset();
  }
  return save(record, next);
}

// Only the first query of an order is recorded; the later ones are the same.
void OrderSteps::note_query(store::OrderRecord& record, bool success) const {
  const OrderSource& source = record.order.source;
  if (record.work.queried || is_received(source.pacs)) return;
  services_.audit.add({.event = store::AuditEvent::kQuery,
                       .success = success,
                       .order = record.order.id,
                       .owner = record.owner,
                       .peer_name = source.pacs,
                       .study = source.study});
  record.work.queried = timestamp_of(now_());
}

Time OrderSteps::wait_for_series(store::OrderRecord& record, const std::stop_token& stop) const {
  OrderSource& source = record.order.source;
  OrderWork& work = record.work;
  SeriesSource& images = this->source(source.pacs);
  std::optional<FoundSeries> series;
  std::vector<std::string> listed;
  try {
    series = images.find_series(source.study, source.series, stop);
    if (series) listed = images.list_instances(source.study, source.series, stop);
  } catch (const Error&) {
    note_query(record, false);
    throw;
  }
  note_query(record, true);
  const Time now = now_();
  if (listed.empty()) {
    if (++work.looks >= kMostLooks) {
      throw PacsFailure(PacsFault::kRefused, "the PACS does not know the series");
    }
    return save_after(OrderState::kWaiting, record,
                      now + settings_.first_delay * (1 << work.looks));
  }
  work.looks = 0;
  if (listed != work.listed || !work.listed_since) {
    work.listed = listed;
    work.listed_since = timestamp_of(now);
  }
  const Time settled = time_of(*work.listed_since) + settings_.settle;
  if (now < settled) {
    return save_after(OrderState::kWaiting, record, std::min(settled, now + settings_.poll));
  }
  if (series->instances && *series->instances != listed.size()) {
    throw PacsFailure(PacsFault::kIncomplete,
                      "the PACS lists " + std::to_string(listed.size()) +
                          " instances of the series, but says that it has " +
                          std::to_string(*series->instances));
  }
  source.instances = static_cast<std::uint32_t>(listed.size());
  record.order.state = OrderState::kFetching;
  return save_after(OrderState::kWaiting, record, now);
}

Time OrderSteps::fetch(store::OrderRecord& record, const std::stop_token& stop) const {
  const OrderSource& source = record.order.source;
  const store::ScratchFolder scratch(services_.folder.scratch());
  const std::filesystem::path file = scratch.path() / "series";
  store::AuditEntry entry = transfer(record, source.pacs, "in", source.study);
  entry.instances = record.work.listed.size();
  if (const auto title = title_of(source.pacs)) {
    // Before they are read: what replaces one of them meanwhile counts as new.
    record.work.contents =
        contents_of(services_.received.instances({*title, source.study, source.series}));
  }
  try {
    const std::string type =
        this->source(source.pacs).fetch_series(source.study, source.series, file, stop);
    const Volume volume = services_.library.add_peers(record.owner, file,
                                                      {.content_type = type,
                                                       .study = source.study,
                                                       .series = source.series,
                                                       .instances = record.work.listed},
                                                      {.cancelled = stop});
    entry.success = true;
    entry.patient_id = volume.dicom->patient_id;
    services_.audit.add(entry);
    if (!record.order.send.empty()) check_identity(*volume.dicom);
    check_patient_of_workitem(record.work, *volume.dicom);
    record.order.volume = volume.id;
    record.work.identity = volume.dicom;
    if (record.order.label_volume) {
      const ImageLattice images = images_of(volume);
      record.work.image_geometry = images.geometry;
      label_grid_of(record, images.dims);  // fails at once if they do not fit
    }
    record.work.segmented_series = segmented_series_of(record, stop);
  } catch (const Error& error) {
    // Images that make no volume have crossed the network, too.
    if (!entry.success && has_bytes(file)) services_.audit.add(entry);
    if (error.code() != ErrorCode::kSeriesIncomplete) throw;
    // An incomplete series is listed again, so that no mesh is made from a part of it.
    forget_images(record);
    throw PacsFailure(PacsFault::kIncomplete, error.what());
  }
  record.order.state = OrderState::kMeshing;
  return save_after(OrderState::kFetching, record, now_());
}

LabelGrid OrderSteps::label_grid_of(
    const store::OrderRecord& record,
    const std::optional<std::array<std::uint32_t, 3>>& image_dims) const {
  try {
    const Volume labels = services_.volumes.get(record.owner, *record.order.label_volume);
    const std::size_t images = record.work.identity->instances.size();
    const auto dims = dims_along(*record.work.image_geometry, labels);
    if (images != dims[2]) {
      throw Error(ErrorCode::kUnusableVolume, "the series has " + std::to_string(images) +
                                                  " images, but the label volume has " +
                                                  std::to_string(dims[2]) + " slices");
    }
    return label_grid(*record.work.image_geometry, image_dims.value_or(dims), labels);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
    throw Error(ErrorCode::kUnusableVolume,
                "the label volume is gone: upload it again, and submit a new order");
  }
}

// Only a report on labels needs it.
std::string OrderSteps::segmented_series_of(const store::OrderRecord& record,
                                            const std::stop_token& stop) const {
  const OrderSource& source = record.order.source;
  const auto& archive = peer(source.pacs).archive;
  if (!is_reported(record.order) || !record.order.parameters.labels || !archive ||
      record.work.identity->segments.empty() || record.work.identity->instances.size() != 1) {
    return "";
  }
  return archive->segmented_series(source.study, source.series, stop);
}

Time OrderSteps::submit_job(store::OrderRecord& record) const {
  JobParameters parameters;
  static_cast<MeshParameters&>(parameters) = record.order.parameters;
  if (record.work.triangles) simplify(record.work, parameters);
  // A report tells how far the mesh may be from the surface.
  if (is_reported(record.order)) parameters.certify = true;
  parameters.volume = record.order.label_volume.value_or(*record.order.volume);
  parameters.priority = record.order.priority;
  const store::Viewer viewer = record.owner;
  if (!parameters.preset.empty()) {
    jobs::resolve_preset(parameters, services_.volumes.get(viewer, parameters.volume));
  }
  if (parameters.labels) {
    const Volume volume = services_.volumes.get(viewer, parameters.volume);
    parameters = jobs::complete_labels(std::move(parameters), viewer, volume, services_.labels);
  }
  const store::Submission submission =
      services_.jobs.submit({.owner = record.owner,
                             .parameters = parameters,
                             .idempotency_key = job_key(record),
                             .request_digest = sha256_of(to_json(parameters))});
  record.order.job = store::job_of(submission).id;
  return save_after(OrderState::kMeshing, record, now_() + kJobLook);
}

// True if the volume or the job has expired or was removed, or the volume is damaged.
bool OrderSteps::is_lost(const Error& error, const store::OrderRecord& record,
                         const std::stop_token& stop) const {
  if (error.code() == ErrorCode::kNotFound || error.code() == ErrorCode::kGone) return true;
  if (error.code() != ErrorCode::kUnusableVolume) return false;
  const auto samples = services_.volumes.samples_of(record.owner, *record.order.volume);
  return !samples || !store::is_there_and_intact(services_.blobs, *samples, stop);
}

Time OrderSteps::mesh(store::OrderRecord& record, const std::stop_token& stop,
                      std::vector<std::string>& stored) const {
  try {
    if (!record.order.job) return submit_job(record);
    const Job job = services_.jobs.get(std::nullopt, *record.order.job);
    if (!is_final(job.state)) {
      return save_after(OrderState::kMeshing, record, now_() + kJobLook);
    }
    if (job.state == JobState::kFailed && job.error) throw to_error(*job.error);
    if (job.state != JobState::kSucceeded) {
      throw Error(ErrorCode::kUnusableVolume, "the order's job was cancelled");
    }
    return make(record, job, stop, stored);
  } catch (const Error& error) {
    if (!is_lost(error, record, stop)) throw;
    forget_images(record);
    record.work.failed_in = OrderState::kSending;
    throw Error(
        ErrorCode::kUnavailable,
        "the volume or the job of the order is gone or damaged; the images are fetched again");
  }
}

Time OrderSteps::make(store::OrderRecord& record, const Job& job, const std::stop_token& stop,
                      std::vector<std::string>& stored) const {
  record.order.results.clear();
  record.work.blobs.clear();
  std::vector<MadeObject> objects;
  if (!record.order.send.empty()) {
    if (job.mesh && job.mesh->triangles == 0) {
      throw empty_surface(*job.mesh,
                          services_.volumes.get(record.owner, *record.order.volume).range);
    }
    check_count_of_objects(record.order, job);
    if (!can_make_objects(job, services_.blobs, stop)) {
      record.order.job = services_.jobs.remake(job.id).id;
      record.work.failed_in = OrderState::kSending;
      throw Error(ErrorCode::kUnavailable,
                  "the mesh is damaged or missing in the store; its job is repeated");
    }
    Making making = {.station_name = settings_.station_name,
                     .most_bytes = std::numeric_limits<std::uint64_t>::max(),
                     .made = job.finished ? time_of(*job.finished) : now_(),
                     .stop = stop};
    if (record.order.label_volume) making.labels = label_grid_of(record);
    for (const SendTarget& target : record.order.send) {
      const PacsSettings* pacs = settings_.find_pacs(target.pacs);
      if (pacs != nullptr) making.most_bytes = std::min(making.most_bytes, pacs->max_send_bytes);
    }
    if (record.work.max_error_mm && !record.work.triangles) {
      const auto triangles = triangles_that_fit(record, job, making, services_.blobs);
      if (triangles) {
        record.work.triangles = *triangles;
        record.order.job.reset();
        return save_after(OrderState::kMeshing, record, now_());
      }
    }
    objects = make_objects(record, job, making, services_.blobs, stored);
  }
  for (const SendTarget& target : record.order.send) {
    for (const MadeObject& object : objects) {
      if (object.format != target.format) continue;
      record.order.results.push_back({.pacs = target.pacs,
                                      .format = target.format,
                                      .label = object.label,
                                      .sop_class_uid = object.sop_class_uid,
                                      .series_uid = object.series_uid,
                                      .sop_instance_uid = object.sop_instance_uid,
                                      .bytes = object.blob.bytes});
      record.work.blobs.push_back(object.blob.key);
    }
  }
  record.order.state = OrderState::kSending;
  return save_after(OrderState::kMeshing, record, now_());
}

}  // namespace isomesh::orders
