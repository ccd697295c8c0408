#include "server/hospital/dicomweb/dicomweb.h"

#include <algorithm>
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
constexpr const char* kStudyFields =
    "includefield=00080020&includefield=00081030&includefield=00100010";
// Limits of a person's search.
constexpr std::size_t kMostStudies = 1000;
constexpr std::size_t kMostSeries = 2000;

FoundSeries series_of(const PeersObject& object) {
  return {.study = object.study,
          .series = object.series,
          .modality = object.modality,
          .description = object.series_description,
          .instances = object.instances};
}

// A value in which wildcards are allowed. Orthanc takes encoded characters literally, and other
// servers reject those that are not encoded, so * stands for them if anything else is left.
std::string encoded_pattern(std::string_view pattern) {
  std::string text;
  bool is_wild = true;
  for (const char& letter : pattern) {
    const bool is_kept = percent_encode({&letter, 1}).size() == 1;
    is_wild = is_wild && !is_kept;
    if (is_kept || letter == '?') {
      text += letter;
    } else if (!text.ends_with('*')) {
      text += '*';
    }
  }
  return is_wild ? percent_encode(pattern) : text;
}

// The query of a search for studies.
std::string studies_query(const SeriesQuery& query) {
  std::string text = '?' + std::string(kStudyFields) + '&' + kPatientField;
  const auto add = [&text](const char* name, const std::string& value) {
    if (!value.empty()) text.append("&").append(name).append("=").append(value);
  };
  add("PatientID", encoded_pattern(query.patient_id));
  add("PatientName", encoded_pattern(query.patient_name));
  add("StudyDate", percent_encode(query.date));
  add("ModalitiesInStudy", percent_encode(query.modality));
  add("StudyInstanceUID", percent_encode(query.study));
  return text;
}

// The reader of responses handles untrusted bytes, so its texts are checked again.
std::string short_text(const std::string& text) {
  constexpr std::size_t kLongest = 256;
  return printable(beginning(text, kLongest));
}

// The part of a series' description that its study has.
PacsSeries study_of(const PeersObject& study) {
  return {.study = study.study,
          .patient_id = short_text(study.patient_id),
          .patient_name = short_text(study.patient_name),
          .study_date = short_text(study.study_date),
          .study_description = short_text(study.study_description)};
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

// True if the PACS did not store the object because it has one with this UID. The UID depends on
// the contents, so that is the same object.
bool is_duplicate(std::optional<std::uint16_t> reason) {
  constexpr std::uint16_t kDuplicate = 0x0111;   // PS3.7, C.5.9
  constexpr std::uint16_t kAzureStored = 45070;  // these two: the DICOM service of Microsoft
  constexpr std::uint16_t kAzureIsBeingStored = 45071;
  return reason == kDuplicate || reason == kAzureStored || reason == kAzureIsBeingStored;
}

// Throws the reason given by the PACS for not storing the object (PS3.18, table I.2-2).
[[noreturn]] void throw_not_stored(std::optional<std::uint16_t> reason) {
  constexpr std::uint16_t kOutOfResources = 0xA700;
  constexpr std::uint16_t kProcessingFailure = 0x0110;
  const std::string said =
      reason ? "the PACS did not store the mesh and gave the reason " + std::to_string(*reason)
             : "the PACS did not store the mesh and gave no reason";
  const bool may_pass =
      !reason || (*reason & 0xFF00) == kOutOfResources || *reason == kProcessingFailure;
  throw PacsFailure(may_pass ? PacsFault::kBusy : PacsFault::kRefused, said);
}

}  // namespace

void check_status(const PeerResponseHead& head) {
  const int status = head.status;
  if (status >= 200 && status < 300) return;
  const std::string said = "the PACS responded with status " + std::to_string(status);
  if (status == 401 || status == 403) throw PacsFailure(PacsFault::kUnauthorized, said);
  constexpr int kNotImplemented = 501;
  const bool is_busy = status == 408 || status == 425 || status == 429 || status >= 500;
  if (is_busy && status != kNotImplemented) {
    throw PacsFailure(PacsFault::kBusy, said, head.retry_after);
  }
  throw PacsFailure(PacsFault::kRefused, said);
}

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

SearchPage DicomWeb::fetch_page(const std::string& target, const std::stop_token& stop,
                                Until until) {
  constexpr int kBadRequest = 400;
  constexpr int kNotFound = 404;
  constexpr int kUnprocessable = 422;
  constexpr std::size_t kEnoughOfRefusal = 4096;
  const ScratchFile response(scratch_, ".response");
  PeerRequest request = {.target = target,
                         .accept = kDicomJson,
                         .response_file = response.path(),
                         .most_bytes = kMostResponseBytes};
  if (until) {
    const auto left = *until - std::chrono::steady_clock::now();
    if (left.count() <= 0) throw PacsFailure(PacsFault::kTimeout, "the PACS takes too long");
    request.most_time = std::chrono::ceil<std::chrono::milliseconds>(left);
  }
  const PeerResponseHead head = peer_.send(request, stop);
  if (head.status == kNotFound) return {.is_not_found = true};
  if (head.status == kBadRequest || head.status == kUnprocessable) {
    return {.refusal = InputFile(response.path()).text(0, kEnoughOfRefusal)};
  }
  check_status(head);
  return {.objects = read_response(responses_, response.path()).objects,
          .has_more = head.has_more_results};
}

SearchResults DicomWeb::search(const SearchQuery& query, const std::stop_token& stop, Until until) {
  return search_all(query,
                    [&](const std::string& target) { return fetch_page(target, stop, until); });
}

std::optional<PeersObject> DicomWeb::search_one(const std::string& target,
                                                std::string PeersObject::*name,
                                                const std::string& uid,
                                                const std::stop_token& stop) {
  // A PACS may ignore the UID in the query, and return other objects first.
  const SearchResults results = search({.target = target, .uid = name, .only = uid}, stop);
  const auto same = std::ranges::find(results.objects, uid, name);
  if (same == results.objects.end()) return std::nullopt;
  return *same;
}

orders::RecentSeries DicomWeb::find_recent(const std::string& from_day, const std::string& modality,
                                           const std::stop_token& stop) {
  const std::string days = "?StudyDate=" + percent_encode(from_day) + '-';
  const std::string value = percent_encode(modality);
  const std::string series_fields = kSeriesFields + (modality.empty() ? "" : "&Modality=" + value);
  if (auto found = find_series_of_all_studies(days + '&' + series_fields, stop)) {
    return *std::move(found);
  }
  const SearchResults studies =
      search({.target = "/studies" + days + (modality.empty() ? "" : "&ModalitiesInStudy=" + value),
              .uid = &PeersObject::study},
             stop);
  orders::RecentSeries recent = {.series = {}, .is_cut = studies.is_cut};
  for (const PeersObject& study : studies.objects) {
    const SearchResults series =
        search({.target = "/studies/" + study.study + "/series?" + series_fields,
                .uid = &PeersObject::series},
               stop);
    recent.is_cut = recent.is_cut || series.is_cut;
    for (const PeersObject& object : series.objects) {
      recent.series.push_back(series_of(object));
      recent.series.back().study = study.study;
    }
  }
  return recent;
}

PacsSeriesList DicomWeb::search(const SeriesQuery& query,
                                std::chrono::steady_clock::time_point until,
                                const std::stop_token& stop) {
  SearchQuery by = {.target = "/studies" + studies_query(query), .uid = &PeersObject::study};
  if (query.study.empty()) {
    by.enough = kMostStudies;
  } else {
    by.only = query.study;
  }
  const SearchResults all = search(by, stop, until);
  if (all.is_not_found) {
    throw PacsFailure(PacsFault::kRefused,
                      "the PACS returned status 404 for /studies: its address may be wrong");
  }
  std::vector<PacsSeries> studies;
  for (const PeersObject& study : all.objects) {
    studies.push_back(study_of(study));
    if (!orders::is_asked_for(studies.back(), query)) studies.pop_back();
  }
  std::ranges::stable_sort(studies, std::ranges::greater(), &PacsSeries::study_date);
  PacsSeriesList found = {.series = {},
                          .complete = !all.is_cut && all.objects.size() < kMostStudies &&
                                      studies.size() <= query.limit};
  studies.resize(std::min(studies.size(), query.limit));
  for (const PacsSeries& study : studies) {
    try {
      add_series(found, study, query, stop, until);
    } catch (const PacsFailure& failure) {
      // After this time, a part is more useful than the failure.
      const bool is_over = std::chrono::steady_clock::now() >= until;
      if (!is_over || failure.fault() != PacsFault::kTimeout || found.series.empty()) throw;
      found.complete = false;
    }
    if (found.series.size() >= kMostSeries || std::chrono::steady_clock::now() >= until) {
      found.complete = found.complete && &study == &studies.back();
      break;
    }
  }
  return found;
}

void DicomWeb::add_series(PacsSeriesList& found, const PacsSeries& study, const SeriesQuery& query,
                          const std::stop_token& stop, Until until) {
  const std::size_t room = kMostSeries - found.series.size();
  SearchResults series = search({.target = "/studies/" + study.study + "/series?" + kSeriesFields,
                                 .uid = &PeersObject::series,
                                 .enough = room + 1},
                                stop, until);
  found.complete = found.complete && !series.is_cut && series.objects.size() <= room;
  series.objects.resize(std::min(series.objects.size(), room));
  for (const PeersObject& object : series.objects) {
    PacsSeries each = study;
    each.series = object.series;
    each.series_description = short_text(object.series_description);
    each.modality = short_text(object.modality);
    each.instances = object.instances;
    if (orders::is_asked_for(each, query)) found.series.push_back(std::move(each));
  }
}

// A PACS need not support this search (PS3.18, 10.6.1). Such a PACS returns 400, 404 or another
// status, or no UIDs of studies.
std::optional<orders::RecentSeries> DicomWeb::find_series_of_all_studies(
    const std::string& query, const std::stop_token& stop) {
  try {
    const SearchResults results =
        search({.target = "/series" + query, .uid = &PeersObject::series}, stop);
    if (results.is_not_found) return std::nullopt;
    orders::RecentSeries recent = {.series = {}, .is_cut = results.is_cut};
    for (const PeersObject& object : results.objects) {
      if (object.study.empty()) return std::nullopt;
      recent.series.push_back(series_of(object));
    }
    return recent;
  } catch (const PacsFailure& failure) {
    if (failure.may_pass()) throw;
    return std::nullopt;
  }
}

std::optional<FoundSeries> DicomWeb::find_series(const std::string& study,
                                                 const std::string& series,
                                                 const std::stop_token& stop) {
  const auto found =
      search_one("/studies/" + study + "/series?SeriesInstanceUID=" + series + '&' + kSeriesFields,
                 &PeersObject::series, series, stop);
  if (!found) return std::nullopt;
  return series_of(*found);
}

std::vector<std::string> DicomWeb::list_instances(const std::string& study,
                                                  const std::string& series,
                                                  const std::stop_token& stop) {
  SearchResults results = search(
      {.target = "/studies/" + study + "/series/" + series + "/instances?includefield=00080018",
       .uid = &PeersObject::instance},
      stop);
  if (results.is_cut) {
    throw PacsFailure(PacsFault::kRefused,
                      "the PACS lists only " + std::to_string(results.objects.size()) +
                          " instances of the series, says that there are more, and ignores the "
                          "offset of a search: increase the number of results that it returns");
  }
  std::vector<std::string> instances;
  for (PeersObject& object : results.objects) instances.push_back(std::move(object.instance));
  std::ranges::sort(instances);
  return instances;
}

std::string DicomWeb::fetch_series(const std::string& study, const std::string& series,
                                   const std::filesystem::path& target,
                                   const std::stop_token& stop) {
  const std::string accepted = "multipart/related; type=\"application/dicom\"";
  const auto get = [&](const std::string& accept) {
    return peer_.send({.target = "/studies/" + study + "/series/" + series,
                       .accept = accept,
                       .response_file = target,
                       .most_bytes = most_series_bytes_},
                      stop);
  };
  constexpr int kNotAcceptable = 406;
  PeerResponseHead head = get(accepted + "; transfer-syntax=" + settings_.transfer_syntax);
  // Some PACS do not know "*". Without it, they convert to Explicit VR Little Endian.
  if (head.status == kNotAcceptable && settings_.transfer_syntax == "*") head = get(accepted);
  if (head.status == kNotAcceptable) {
    throw PacsFailure(PacsFault::kRefused,
                      "the PACS does not send the series in the transfer syntax that was requested "
                      "(status 406): set transfer-syntax of this PACS to one that it supports");
  }
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
  const auto found = search_one("/studies?StudyInstanceUID=" + study + '&' + kPatientField,
                                &PeersObject::study, study, stop);
  if (!found) return std::nullopt;
  return found->patient_id;
}

bool DicomWeb::has_instance(const orders::InstancePlace& place, const std::stop_token& stop) {
  return search_one("/studies/" + place.study + "/series/" + place.series +
                        "/instances?SOPInstanceUID=" + place.instance,
                    &PeersObject::instance, place.instance, stop)
      .has_value();
}

std::string DicomWeb::segmented_series(const std::string& study, const std::string& series,
                                       const std::stop_token& stop) {
  const SearchPage metadata =
      fetch_page("/studies/" + study + "/series/" + series + "/metadata", stop);
  return metadata.objects.size() == 1 ? metadata.objects.front().segmented_series : "";
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
  if (failed != said.failed.end()) {
    if (is_duplicate(failed->failure)) return;
    throw_not_stored(failed->failure);
  }
  if (head.status == kConflict) {
    throw PacsFailure(PacsFault::kRefused, "the PACS responded with status 409");
  }
  throw PacsFailure(PacsFault::kNotStored, "the PACS did not confirm that it stored the mesh");
}

}  // namespace isomesh::dicomweb
