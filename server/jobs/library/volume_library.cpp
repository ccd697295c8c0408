#include "server/jobs/library/volume_library.h"

#include "base/clock.h"
#include "base/hex.h"
#include "base/sha256.h"
#include "proto/error.h"
#include "proto/json.h"

namespace isomesh::jobs {
namespace {

// True if the upload was rejected only because it has several volumes.
bool leaves_members_open(const Error& error, const ImportOptions& options) {
  const std::vector<Choice>& choices = error.remedy().choices;
  return options.member.empty() && !choices.empty() && choices.front().parameter == "member";
}

// The id of a volume: the digest of its record, with a key for what may concern persons. Without
// it, anyone who sees an id, for instance in a log, could test whose it is.
std::string id_of(Volume volume, const std::string& key) {
  Volume persons;
  persons.dicom = std::exchange(volume.dicom, {});
  persons.name = std::exchange(volume.name, {});
  persons.ignored = std::exchange(volume.ignored, {});
  const std::string text = to_record(volume);
  return sha256_of(text + to_hex(hmac_sha256(key, to_record(persons))));
}

std::filesystem::path canonical_in(const store::ScratchFolder& scratch) {
  return scratch.path() / "canonical";
}

}  // namespace

std::pair<Volume, bool> VolumeLibrary::add(const std::string& owner,
                                           const std::filesystem::path& upload,
                                           const ImportOptions& options, const UploadName& name,
                                           const std::string& party, const ImportControl& control) {
  const store::ScratchFolder scratch(folder_.scratch());
  Volume volume = import_file(upload, options, party, scratch, control.cancelled);
  if (!name.text.empty() && (name.is_chosen || !volume.name)) volume.name = name.text;
  return keep(owner, std::move(volume), scratch, control);
}

Volume VolumeLibrary::add_peers(const std::string& owner, const std::filesystem::path& response,
                                const PeersSeries& series, const ImportControl& control) {
  const store::ScratchFolder scratch(folder_.scratch());
  Volume volume = import_file(response, {.peers = series}, owner, scratch, control.cancelled);
  if (!volume.dicom) throw Error(ErrorCode::kInternal, "images from a PACS have no DICOM identity");
  return keep(owner, std::move(volume), scratch, control).first;
}

Volume VolumeLibrary::import_file(const std::filesystem::path& upload, const ImportOptions& options,
                                  const std::string& party, const store::ScratchFolder& scratch,
                                  const std::stop_token& cancelled) {
  try {
    return runner_.run({.source = upload,
                        .scratch = scratch.path(),
                        .target = canonical_in(scratch),
                        .options = options,
                        .limits = limits_},
                       party, cancelled);
  } catch (const Error&) {
    folder_.check_is_there();  // otherwise the file is not to blame
    throw;
  }
}

std::pair<Volume, bool> VolumeLibrary::keep(const std::string& owner, Volume volume,
                                            const store::ScratchFolder& scratch,
                                            const ImportControl& control) {
  const store::Blob blob = store::digest_of(canonical_in(scratch));
  if (control.cancelled.stop_requested()) throw_cancelled();
  // Also required if another owner has the same samples; otherwise the outcome on a full disk would
  // reveal that.
  if (!volumes_.has_samples(owner, blob.key)) {
    retention_.make_room({.owner = owner, .bytes = blob.bytes});
  }
  // The store keeps the blob for mark_named(), so nobody has to wait for it.
  try {
    runner_.until_stopped(control.cancelled, [&](const std::stop_token& stop) {
      blobs_.adopt(canonical_in(scratch), blob, owner, stop);
    });
  } catch (const Error& error) {
    // A remote store may have the bytes nevertheless.
    if (error.code() == ErrorCode::kCancelled) eraser_.erase(blob.key, [] {});
    throw;
  }
  volume.samples = blob.key;
  volume.id = id_of(volume, volumes_.key());
  volume.created = timestamp();
  auto stored = volumes_.add(owner, volume);
  if (control.stored) control.stored(volume.id);
  blobs_.mark_named(blob.key);
  return stored;
}

std::vector<UploadedVolume> VolumeLibrary::add_all(const std::string& owner,
                                                   const std::filesystem::path& upload,
                                                   const ImportOptions& options,
                                                   const UploadName& name, const std::string& party,
                                                   const ImportControl& control) {
  const auto add_one = [&](const ImportOptions& how, const UploadName& called) {
    auto [volume, is_new] = add(owner, upload, how, called, party, control);
    return UploadedVolume{.member = how.member, .status = is_new ? 201 : 200, .volume = volume};
  };
  std::vector<Choice> members;
  try {
    return {add_one(options, name)};
  } catch (const Error& error) {
    if (!leaves_members_open(error, options)) throw;
    members = error.remedy().choices;
  }
  std::vector<UploadedVolume> volumes;
  for (const Choice& member : members) {
    ImportOptions how = options;
    how.member = member.value;
    // One name for several volumes needs the member's beside it.
    const UploadName called =
        name.is_chosen ? UploadName{name.text + ": " + member.value, true} : name;
    try {
      volumes.push_back(add_one(how, called));
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kCancelled || describe(error.code()).status >= 500) throw;
      const Problem problem = to_problem(error, "");
      volumes.push_back({.member = member.value, .status = problem.status, .problem = problem});
    }
  }
  return volumes;
}

void VolumeLibrary::erase(const store::Viewer& viewer, const std::string& id) {
  const auto erase_record = [&] { volumes_.erase(viewer, id); };
  const auto samples = volumes_.samples_of(viewer, id);
  if (!samples) return erase_record();  // throws
  eraser_.erase(*samples, erase_record);
}

}  // namespace isomesh::jobs
