#include "server/hospital/orders/received.h"

#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include <fcntl.h>

#include "base/clock.h"
#include "base/descriptor.h"
#include "base/hex.h"
#include "base/ids.h"
#include "base/log.h"
#include "base/sha256.h"
#include "server/hospital/orders/orders.h"
#include "server/hospital/orders/unnamed.h"

namespace isomesh::orders {
namespace {

constexpr std::string_view kPrefix = "dimse:";

void append(const Descriptor& file, const std::string& text) {
  write_all(file, std::as_bytes(std::span(text)));
}

// Returns false if the blob is missing, or its bytes are not those that were received: a mesh made
// from them would be wrong. Files are read once, so they are not checked beforehand.
bool append(const Descriptor& file, const store::BlobStore& blobs, const std::string& key) {
  std::unique_ptr<store::BlobReader> blob;
  try {
    blob = blobs.open(key);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNotFound) return false;
    throw;
  }
  Sha256 digest;
  std::vector<std::byte> buffer(std::size_t{1} << 20);
  std::uint64_t at = 0;
  while (const std::size_t count = blob->read_at(at, buffer)) {
    const auto bytes = std::span<const std::byte>(buffer).first(count);
    digest.update(bytes);
    write_all(file, bytes);
    at += count;
  }
  return to_hex(digest.finish()) == key;
}

}  // namespace

std::string received_by(const std::string& title) { return std::string(kPrefix) + title; }

bool is_received(std::string_view pacs) { return pacs.starts_with(kPrefix); }

std::optional<std::string> title_of(std::string_view pacs) {
  if (!is_received(pacs)) return std::nullopt;
  return std::string(pacs.substr(kPrefix.size()));
}

std::vector<std::string> contents_of(const std::vector<store::ReceivedInstance>& instances) {
  constexpr std::size_t kEnough = 16;  // letters of a digest
  std::vector<std::string> contents;
  for (const store::ReceivedInstance& each : instances) {
    if (!each.blob.empty()) contents.push_back(each.instance + ' ' + each.blob.substr(0, kEnough));
  }
  return contents;
}

std::optional<FoundSeries> Received::find_series(const std::string& study,
                                                 const std::string& series,
                                                 const std::stop_token&) {
  const auto known = received_.instances({title_, study, series});
  if (known.empty()) return std::nullopt;
  return FoundSeries{.study = study,
                     .series = series,
                     .modality = "",
                     .description = "",
                     .instances = static_cast<std::uint32_t>(known.size())};
}

std::vector<std::string> Received::list_instances(const std::string& study,
                                                  const std::string& series,
                                                  const std::stop_token&) {
  std::vector<std::string> instances;
  for (const store::ReceivedInstance& each : received_.instances({title_, study, series})) {
    instances.push_back(each.instance);
  }
  return instances;
}

std::string Received::fetch_series(const std::string& study, const std::string& series,
                                   const std::filesystem::path& target,
                                   const std::stop_token& stop) {
  constexpr std::size_t kBoundaryBytes = 24;
  const std::string boundary = random_hex(kBoundaryBytes);
  const Descriptor file(::open(target.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (file.number() < 0) throw_system_error("open", errno);
  const auto instances = received_.instances({title_, study, series});
  for (const store::ReceivedInstance& each : instances) {
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "the order was cancelled");
    if (each.blob.empty()) {
      throw PacsFailure(PacsFault::kIncomplete,
                        "some instances of the series were received earlier and are no longer "
                        "stored: send the whole series again");
    }
    append(file, "\r\n--" + boundary + "\r\nContent-Type: application/dicom\r\n\r\n");
    if (!append(file, blobs_, each.blob)) {
      if (received_.instances({title_, study, series}) != instances) {
        throw PacsFailure(PacsFault::kIncomplete, "the series changed while it was read");
      }
      throw Error(ErrorCode::kUnusableVolume,
                  "the received image " + each.instance +
                      " is damaged or missing in the store: send the whole series again");
    }
  }
  append(file, "\r\n--" + boundary + "--\r\n");
  return "multipart/related; type=\"application/dicom\"; boundary=" + boundary;
}

// Submits an order for the held series if it needs one. Releases the held instances once an order
// has covered all of them.
store::ReceivedFate Orders::look_at_received(const store::HeldSeries& held) {
  const auto& [title, study, series] = held.series;
  const auto route = settings_.dimse->routes.find(title);
  // Kept, because the route may be configured again.
  if (route == settings_.dimse->routes.end()) return store::ReceivedFate::kOpen;
  const Rule& rule = *settings_.find_rule(route->second);
  const FoundSeries found = {
      .study = study, .series = series, .modality = "", .description = "", .instances = held.known};
  store::OrderRecord record = make_order(rule, received_by(title), found);
  // The series has settled already, so the order gets its list and does not wait.
  const auto instances = services_.received.instances(held.series);
  for (const auto& each : instances) record.work.listed.push_back(each.instance);
  record.work.listed_since = timestamp_of(held.last);
  const store::ReceivedFate fate = services_.orders.submit_received(
      {.record = record, .idempotency_key = "", .request_digest = ""},
      {.rule = rule.name,
       .study = study,
       .series = series,
       .instances = held.known,
       .contents = contents_of(instances)},
      held.last, settings_.most_open);
  if (fate == store::ReceivedFate::kNew) {
    log(record, "");
    changed();
  } else if (fate == store::ReceivedFate::kDone) {
    erase_unnamed(services_.blobs, services_.volumes, services_.received.release(held));
  }
  return fate;
}

void Orders::receive(const std::stop_token& stop) {
  constexpr std::chrono::milliseconds kPause{500};
  // Peers could not send before this process started.
  const store::Time begun = options_.now();
  // Time of the next check of each waiting series.
  std::map<store::ReceivedSeries, store::Time> waiting;
  while (!stop.stop_requested()) {
    try {
      const store::Time now = options_.now();
      if (is_paused()) waiting.clear();
      std::erase_if(waiting, [&](const auto& each) { return each.second <= now; });
      for (const store::HeldSeries& held : services_.received.held()) {
        if (is_paused() || std::max(held.last, begun) + settings_.settle > now ||
            waiting.contains(held.series)) {
          continue;
        }
        // Set first, so that a series that fails also waits and does not block others.
        waiting[held.series] = now + settings_.poll;
        if (look_at_received(held) == store::ReceivedFate::kDone) waiting.erase(held.series);
      }
    } catch (const std::exception& error) {
      log_error("received series could not be processed and are retried: {}", error.what());
    }
    isomesh::pause(stop, kPause);
  }
}

}  // namespace isomesh::orders
