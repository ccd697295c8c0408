#include "server/http/requests/partial_upload.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

#include "base/error.h"
#include "base/files.h"
#include "proto/json_values.h"
#include "server/store/file.h"

namespace isomesh::http {
namespace {

constexpr const char* kNoteSuffix = ".json";

// The id of this boot; empty if the system has none.
const std::string& this_boot() {
  static const std::string boot = [] {
    std::string text;
    std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), text);
    return text;
  }();
  return boot;
}

Error was_cancelled() { return {ErrorCode::kCancelled, "the upload was cancelled"}; }

// As the file of a note holds it.
struct StoredNote {
  std::string boot;
  PartialNote note;
  std::vector<std::array<std::string, 2>> query;
  std::optional<std::vector<std::array<std::string, 2>>> read_with;  // older versions: missing
};

void visit(Is<StoredNote> auto& self, auto&& field) {
  field("boot", self.boot);
  field("owner", self.note.owner);
  field("query", self.query);
  field("name", self.note.upload_name.text);
  field("name_is_chosen", self.note.upload_name.is_chosen);
  field("sha256", self.note.sha256);
  field("complete", self.note.is_complete);
  field("volume", self.note.volume);
  field("read_with", self.read_with);
  field("length", self.note.length);
}

std::string text_of(const PartialNote& note) {
  StoredNote stored = {.boot = this_boot(), .note = note, .query = {}, .read_with = {}};
  for (const auto& [name, value] : note.query) stored.query.push_back({name, value});
  stored.read_with.emplace();
  for (const auto& [name, value] : note.read_with) stored.read_with->push_back({name, value});
  return json_values::to_text(stored);
}

StoredNote stored_note(const std::string& text) {
  try {
    return json_values::from_text<StoredNote>(text);
  } catch (const Error&) {
    throw Error(ErrorCode::kGone, "its record is damaged");
  }
}

PartialNote note_from(const std::filesystem::path& path) {
  StoredNote stored = stored_note(read_whole(path));
  // Bytes not yet on disk are lost, regardless of the file's length.
  if (this_boot().empty() || stored.boot != this_boot()) {
    throw Error(ErrorCode::kGone, "the machine was restarted since");
  }
  for (const auto& [name, value] : stored.query) stored.note.query.emplace_back(name, value);
  if (!stored.read_with) stored.read_with = stored.query;
  for (const auto& [name, value] : *stored.read_with) {
    stored.note.read_with.emplace_back(name, value);
  }
  return std::move(stored.note);
}

Descriptor opened(const std::filesystem::path& path, int flags) {
  Descriptor file(::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC | flags, 0600));
  if (file.number() < 0) throw_system_error("opening an upload", errno);
  return file;
}

}  // namespace

PartialUpload::File::~File() {
  std::error_code ignored;  // leftovers are found at the next start and expire then
  if (goes) std::filesystem::remove(body.path, ignored);
}

PartialUpload::PartialUpload(const std::filesystem::path& folder, std::string name,
                             PartialNote note)
    : name_(std::move(name)),
      path_(folder / name_),
      note_path_(path_.string() + kNoteSuffix),
      note_(std::move(note)) {
  const Lock lock(mutex_);
  write_note();
  bytes_file_->body.name = note_.upload_name;
  file_ = opened(path_, O_CREAT | O_EXCL);
}

PartialUpload::PartialUpload(const std::filesystem::path& folder, std::string name)
    : name_(std::move(name)), path_(folder / name_), note_path_(path_.string() + kNoteSuffix) {
  const Lock lock(mutex_);
  note_ = note_from(note_path_);
  bytes_file_->body.name = note_.upload_name;
  if (!note_.volume.empty()) {
    bytes_file_->goes = true;  // may remain after a kill
    bytes_file_.reset();
    return;
  }
  file_ = opened(path_, 0);
  bytes_ = std::filesystem::file_size(path_);
}

PartialUpload::~PartialUpload() {
  const Lock lock(mutex_);
  std::error_code ignored;
  if (is_let_go_) std::filesystem::remove(note_path_, ignored);
}

std::shared_ptr<const ReceivedBody> PartialUpload::body() const {
  const Lock lock(mutex_);
  if (!bytes_file_) return nullptr;
  return {bytes_file_, &bytes_file_->body};
}

PartialNote PartialUpload::note() const {
  const Lock lock(mutex_);
  return note_;
}

std::uint64_t PartialUpload::bytes() const {
  const Lock lock(mutex_);
  return bytes_;
}

std::filesystem::file_time_type PartialUpload::written_at() const {
  std::error_code absent;
  const auto time = std::filesystem::last_write_time(path_, absent);
  return absent ? std::filesystem::last_write_time(note_path_) : time;
}

std::uint64_t PartialUpload::end_leases() {
  const Lock lock(mutex_);
  ++lease_;
  return offset();
}

std::optional<PartialLease> PartialUpload::begin_lease(std::uint64_t offset) {
  const Lock lock(mutex_);
  ++lease_;
  if (this->offset() != offset) return std::nullopt;
  return PartialLease{lease_, offset};
}

void PartialUpload::tell_length(const Lease& lease, std::uint64_t length) {
  const Lock lock(mutex_);
  check(lease);
  if (note_.length == length) return;
  if (note_.length || length < bytes_) {
    throw invalid_parameter("Upload-Length", "differs from the length of this upload");
  }
  note_.length = length;
  write_note();
}

void PartialUpload::write(const Lease& lease, std::span<const std::byte> bytes) {
  const Lock lock(mutex_);
  check(lease);
  if (note_.length && bytes.size() > *note_.length - bytes_) {
    throw invalid_parameter("Upload-Length", "the body exceeds the upload's length");
  }
  try {
    write_all(file_, bytes);
  } catch (const Error&) {
    // A full disk may have taken some of them; discard those.
    cut(bytes_);
    throw;
  }
  bytes_ += bytes.size();
}

void PartialUpload::take_back(const Lease& lease) {
  const Lock lock(mutex_);
  check(lease);
  cut(lease.offset);
}

void PartialUpload::complete(const Lease& lease) {
  const Lock lock(mutex_);
  check(lease);
  if (bytes_ == 0) throw Error(ErrorCode::kInvalidParameter, "the body is empty");
  if (note_.length.value_or(bytes_) != bytes_) {
    throw invalid_parameter("Upload-Complete", "the upload has fewer bytes than its length");
  }
  note_.length = bytes_;
  note_.is_complete = true;
  write_note();
}

void PartialUpload::become(const std::string& volume, const Parameters& read_with) {
  const Lock lock(mutex_);
  note_.volume = volume;
  note_.read_with = read_with;
  write_note();
  bytes_ = 0;
  file_ = Descriptor();
  if (bytes_file_) bytes_file_->goes = true;
  bytes_file_.reset();
}

void PartialUpload::let_go() {
  const Lock lock(mutex_);
  is_let_go_ = true;
  if (bytes_file_) bytes_file_->goes = true;
  ++lease_;
}

PartialUpload::Reading::Reading(std::shared_ptr<PartialUpload> upload)
    : upload_(std::move(upload)) {
  if (!upload_) return;
  const Lock lock(upload_->mutex_);
  if (upload_->cancelled_.stop_requested()) throw was_cancelled();
  ++upload_->readings_;
}

PartialUpload::Reading::~Reading() {
  if (!upload_) return;
  const Lock lock(upload_->mutex_);
  --upload_->readings_;
  upload_->reading_ended_.notify_all();
}

std::stop_token PartialUpload::Reading::cancelled() const {
  return upload_ ? upload_->cancelled_.get_token() : std::stop_token();
}

void PartialUpload::Reading::stored(const std::string& id) const {
  if (!upload_) return;
  const Lock lock(upload_->mutex_);
  if (std::ranges::count(upload_->stored_, id) == 0) upload_->stored_.push_back(id);
}

std::vector<std::string> PartialUpload::cancel() {
  cancelled_.request_stop();
  Lock lock(mutex_);
  reading_ended_.wait(lock, [this]() ISOMESH_REQUIRES(mutex_) { return readings_ == 0; });
  return stored_;
}

std::uint64_t PartialUpload::offset() const {
  return note_.is_complete ? note_.length.value_or(bytes_) : bytes_;
}

void PartialUpload::cut(std::uint64_t bytes) {
  if (::ftruncate(file_.number(), static_cast<off_t>(bytes)) != 0) {
    throw_system_error("cutting an upload", errno);
  }
  bytes_ = bytes;
}

void PartialUpload::check(const Lease& lease) const {
  if (cancelled_.stop_requested()) throw was_cancelled();
  if (lease.number != lease_) {
    throw Error(ErrorCode::kUnavailable, "another request continues this upload");
  }
  if (note_.is_complete) {
    throw invalid_parameter("Upload-Complete", "this upload is already complete");
  }
}

void PartialUpload::write_note() const {
  const std::filesystem::path part = note_path_.string() + ".part";
  std::error_code absent;
  std::filesystem::remove(part, absent);
  const std::string text = text_of(note_);
  store::File::create(part).write(std::as_bytes(std::span(text)));
  store::move_to(part, note_path_);
}

}  // namespace isomesh::http
