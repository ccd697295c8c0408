#include "server/hospital/dicomweb/dicomweb.h"

#include <algorithm>
#include <set>
#include <utility>

#include "base/files.h"
#include "base/ids.h"
#include "base/text.h"

namespace isomesh::dicomweb {
namespace {

using orders::FoundSeries;
using orders::PacsFailure;
using orders::PacsFault;

constexpr std::uint64_t kMostResponseBytes = std::uint64_t{64} << 20;
constexpr const char* kDicomJson = "application/dicom+json";
// Optional attributes to include in results about series and studies.
constexpr const char* kSeriesFields =
    "includefield=00201209&includefield=00080060&includefield=0008103E";
constexpr const char* kPatientField = "includefield=00100020";

// Throws unless the status promises a response of the requested kind.
void check_status(const PeerResponseHead& head) {
  const int status = head.status;
  if (status >= 200 && status < 300) return;
  const std::string said = "the PACS responded with status " + std::to_string(status);
  if (status == 401 || status == 403) throw PacsFailure(PacsFault::kUnauthorized, said);
  if (status == 408 || status == 425 || status == 429 || status >= 500) {
    throw PacsFailure(PacsFault::kBusy, said, head.retry_after);
  }
  throw PacsFailure(PacsFault::kRefused, said);
}

FoundSeries series_of(const PeersObject& object) {
  return {.study = object.study,
          .series = object.series,
          .modality = object.modality,
          .description = object.series_description,
          .instances = object.instances};
}

// The multipart body of an object as one stream.
class MultipartBody {
 public:
  MultipartBody(std::string before, const orders::OutgoingObject& object, std::string after)
      : before_(std::move(before)), object_(object), after_(std::move(after)) {}

  std::uint64_t bytes() const { return before_.size() + object_.bytes + after_.size(); }

  std::size_t read(std::span<std::byte> buffer) {
    const std::uint64_t object_end = before_.size() + object_.bytes;
    std::size_t count = 0;
    if (at_ < before_.size()) {
      count = copy(before_, at_, buffer);
    } else if (at_ < object_end) {
      const std::uint64_t left = object_end - at_;
      const auto piece = buffer.first(std::min<std::uint64_t>(left, buffer.size()));
      count = object_.read(at_ - before_.size(), piece);
      if (count == 0) throw Error(ErrorCode::kInternal, "a stored object became shorter");
    } else {
      count = copy(after_, at_ - object_end, buffer);
    }
    at_ += count;
    return count;
  }

 private:
  static std::size_t copy(const std::string& text, std::uint64_t from,
                          std::span<std::byte> buffer) {
    const auto bytes = std::as_bytes(std::span(text)).subspan(from);
    const std::size_t count = std::min(bytes.size(), buffer.size());
    std::copy_n(bytes.begin(), count, buffer.begin());
    return count;
  }

  const std::string before_;
  const orders::OutgoingObject& object_;
  const std::string after_;
  std::uint64_t at_ = 0;
};

bool names(const std::vector<PeersObject>& objects, const std::string& instance) {
  return std::ranges::find(objects, instance, &PeersObject::instance) != objects.end();
}

// Throws the reason given by the PACS for not storing the object (PS3.18, table I.2-2).
[[noreturn]] void throw_not_stored(std::optional<std::uint16_t> reason) {
  constexpr std::uint16_t kOutOfResources = 0xA700;
  const std::string said =
      reason ? "the PACS did not store the mesh and gave the reason " + std::to_string(*reason)
             : "the PACS did not store the mesh and gave no reason";
  const bool may_pass = !reason || (*reason & 0xFF00) == kOutOfResources;
  throw PacsFailure(may_pass ? PacsFault::kBusy : PacsFault::kRefused, said);
}

}  // namespace

PeersResponse read_response(jobs::ImportRunner& runner, const std::filesystem::path& file) {
  try {
    return runner.read_response(file);
  } catch (const jobs::ImportTookTooLong&) {
    throw Error(ErrorCode::kPacsUnreachable, "reading the response of the PACS took too long");
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInvalidParameter) {
      throw Error(ErrorCode::kPacsUnreachable, error.what());
    }
    if (error.code() != ErrorCode::kUnusableVolume) throw;
    throw Error(ErrorCode::kPacsUnreachable, "the response of the PACS cannot be read");
  }
}

DicomWeb::DicomWeb(const orders::PacsSettings& settings, std::filesystem::path scratch,
                   std::uint64_t most_series_bytes, jobs::ImportRunner& responses)
    : settings_(settings),
      peer_(settings),
      scratch_(std::move(scratch)),
      most_series_bytes_(most_series_bytes),
      responses_(responses) {}

std::vector<PeersObject> DicomWeb::search(const std::string& target, const std::stop_token& stop) {
  constexpr int kNotFound = 404;
  const ScratchFile response(scratch_, ".response");
  const PeerResponseHead head = peer_.send({.target = target,
                                            .accept = kDicomJson,
                                            .response_file = response.path(),
                                            .most_bytes = kMostResponseBytes},
                                           stop);
  if (head.status == kNotFound) return {};  // some PACS respond so if nothing is found
  check_status(head);
  return read_response(responses_, response.path()).objects;
}

std::vector<PeersObject> DicomWeb::search_all(const std::string& target,
                                              std::string PeersObject::*name,
                                              const std::stop_token& stop) {
  constexpr std::size_t kPage = 1000;
  constexpr std::size_t kMost = 100'000;
  std::vector<PeersObject> all;
  std::set<std::string> known;
  while (known.size() < kMost) {
    const std::vector<PeersObject> page = search(
        target + "&limit=" + std::to_string(kPage) + "&offset=" + std::to_string(all.size()), stop);
    const std::size_t before = known.size();
    for (const PeersObject& object : page) {
      if ((object.*name).empty()) {
        throw PacsFailure(PacsFault::kUnreadable, "the PACS lists objects without UIDs");
      }
      if (known.insert(object.*name).second) all.push_back(object);
    }
    // A PACS without paging returns everything each time, and some return smaller pages than
    // requested. So only a page without new objects is the end.
    if (known.size() == before) return all;
  }
  throw Error(ErrorCode::kTooLarge, "the PACS found more than " + std::to_string(kMost) +
                                        " objects, the most that are accepted");
}

std::vector<FoundSeries> DicomWeb::find_recent(const std::string& from_day,
                                               const std::string& modality,
                                               const std::stop_token& stop) {
  std::string target = "/series?StudyDate=" + percent_encode(from_day) + "-&" + kSeriesFields;
  if (!modality.empty()) target += "&Modality=" + percent_encode(modality);
  std::vector<FoundSeries> found;
  for (const PeersObject& object : search_all(target, &PeersObject::series, stop)) {
    if (!object.study.empty()) found.push_back(series_of(object));
  }
  return found;
}

std::optional<FoundSeries> DicomWeb::find_series(const std::string& study,
                                                 const std::string& series,
                                                 const std::stop_token& stop) {
  const std::vector<PeersObject> found = search(
      "/studies/" + study + "/series?SeriesInstanceUID=" + series + '&' + kSeriesFields, stop);
  const auto same = std::ranges::find(found, series, &PeersObject::series);
  if (same == found.end()) return std::nullopt;
  return series_of(*same);
}

std::vector<std::string> DicomWeb::list_instances(const std::string& study,
                                                  const std::string& series,
                                                  const std::stop_token& stop) {
  std::vector<std::string> instances;
  const std::string target =
      "/studies/" + study + "/series/" + series + "/instances?includefield=00080018";
  for (PeersObject& object : search_all(target, &PeersObject::instance, stop)) {
    instances.push_back(std::move(object.instance));
  }
  std::ranges::sort(instances);
  return instances;
}

std::string DicomWeb::fetch_series(const std::string& study, const std::string& series,
                                   const std::filesystem::path& target,
                                   const std::stop_token& stop) {
  const PeerResponseHead head =
      peer_.send({.target = "/studies/" + study + "/series/" + series,
                  .accept = "multipart/related; type=\"application/dicom\"; transfer-syntax=" +
                            settings_.transfer_syntax,
                  .response_file = target,
                  .most_bytes = most_series_bytes_},
                 stop);
  constexpr int kPartialContent = 206;
  constexpr int kNotFound = 404;
  if (head.status == kPartialContent || head.status == kNotFound) {
    throw PacsFailure(PacsFault::kIncomplete, "the PACS no longer has the whole series");
  }
  check_status(head);
  return head.content_type;
}

std::optional<std::string> DicomWeb::patient_of(const std::string& study,
                                                const std::stop_token& stop) {
  const std::vector<PeersObject> found =
      search("/studies?StudyInstanceUID=" + study + '&' + kPatientField, stop);
  const auto same = std::ranges::find(found, study, &PeersObject::study);
  if (same == found.end()) return std::nullopt;
  return same->patient_id;
}

bool DicomWeb::has_instance(const orders::InstancePlace& place, const std::stop_token& stop) {
  return names(search("/studies/" + place.study + "/series/" + place.series +
                          "/instances?SOPInstanceUID=" + place.instance,
                      stop),
               place.instance);
}

void DicomWeb::store(const orders::OutgoingObject& object, const std::stop_token& stop) {
  // Random, so that no mesh contains it: a PACS would truncate the object there.
  constexpr std::size_t kBoundaryBytes = 24;
  const std::string boundary = random_hex(kBoundaryBytes);
  MultipartBody multipart("--" + boundary + "\r\nContent-Type: application/dicom\r\n\r\n", object,
                          "\r\n--" + boundary + "--\r\n");
  const RequestBody body = {
      .content_type = "multipart/related; type=\"application/dicom\"; boundary=" + boundary,
      .bytes = multipart.bytes(),
      .read = [&](std::span<std::byte> buffer) { return multipart.read(buffer); }};
  const ScratchFile response(scratch_, ".response");
  const PeerResponseHead head = peer_.send({.target = "/studies/" + object.place.study,
                                            .accept = kDicomJson,
                                            .body = &body,
                                            .response_file = response.path(),
                                            .most_bytes = kMostResponseBytes},
                                           stop);
  constexpr int kConflict = 409;  // the body has the reason
  if (head.status != kConflict) check_status(head);
  const PeersResponse said = read_response(responses_, response.path());
  const std::string& instance = object.place.instance;
  if (names(said.stored, instance)) return;
  const auto failed = std::ranges::find(said.failed, instance, &PeersObject::instance);
  if (failed != said.failed.end()) throw_not_stored(failed->failure);
  if (head.status == kConflict) {
    throw PacsFailure(PacsFault::kRefused, "the PACS responded with status 409");
  }
  throw PacsFailure(PacsFault::kNotStored, "the PACS did not confirm that it stored the mesh");
}

}  // namespace isomesh::dicomweb
