#include "client/cli/ids.h"

#include <algorithm>
#include <cctype>

#include "client/cli/text.h"
#include "proto/error.h"

namespace isomesh::cli {
namespace {

constexpr std::size_t kShortest = 4;
constexpr std::size_t kVolumeId = 64;  // a SHA-256 in hexadecimal
constexpr std::size_t kTimedId = 36;   // of jobs and the like: a UUID
constexpr std::size_t kMostListed = 10;

bool is_hexadecimal(const std::string& text) {
  const auto is_digit = [](unsigned char c) {
    return std::isdigit(c) != 0 || (c >= 'a' && c <= 'f');
  };
  return std::ranges::all_of(text, is_digit);
}

// True for text that is looked up as given; the server reports errors in it.
bool is_whole(const std::string& text, std::size_t whole) {
  const auto is_of_id = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-'; };
  return text.size() < kShortest || text.size() >= whole || !std::ranges::all_of(text, is_of_id);
}

std::vector<Candidate> volumes_of(Client& client) {
  std::vector<Candidate> all;
  for (const Volume& volume : client.volumes()) {
    all.push_back({volume.id, volume.name.value_or("")});
  }
  return all;
}

std::vector<Candidate> candidates_of(const std::vector<Job>& jobs) {
  std::vector<Candidate> all;
  for (const Job& job : jobs) {
    all.push_back({job.id, std::string(to_string(job.state)) + "  " + job.created});
  }
  return all;
}

}  // namespace

bool may_be_volume_id(const std::string& text) {
  return text.size() >= kShortest && text.size() <= kVolumeId && is_hexadecimal(text);
}

bool is_stored_volume(const std::filesystem::path& path) {
  std::error_code error;
  return path != "-" && may_be_volume_id(path.string()) && !std::filesystem::exists(path, error);
}

std::string whole_id(const std::string& text, const std::string& kind,
                     const std::vector<Candidate>& candidates) {
  std::vector<Candidate> found;
  for (const Candidate& each : candidates) {
    if (each.id == text) return each.id;
    if (each.id.starts_with(text) || each.id.ends_with(text)) found.push_back(each);
  }
  if (found.size() == 1) return found.front().id;
  if (found.empty()) {
    throw Error(ErrorCode::kNotFound,
                "there is no " + kind + " whose id begins or ends with " + text);
  }
  std::vector<std::vector<std::string>> rows;
  for (const Candidate& each : found) {
    if (rows.size() == kMostListed) break;
    rows.push_back({each.id, each.title});
  }
  std::string list = in_columns({Align::kLeft, Align::kLeft}, rows);
  list.pop_back();
  if (found.size() > kMostListed) {
    list += "\n  and " + std::to_string(found.size() - kMostListed) + " more";
  }
  throw Error(ErrorCode::kInvalidParameter, "the id " + text +
                                                " is ambiguous: " + std::to_string(found.size()) +
                                                ' ' + kind + "s have it\n" + list);
}

std::string timed_id(const std::string& text, const std::string& kind,
                     const std::function<std::vector<Candidate>()>& candidates) {
  return is_whole(text, kTimedId) ? text : whole_id(text, kind, candidates());
}

std::string volume_id(Client& client, const std::string& text) {
  return is_whole(text, kVolumeId) ? text : whole_id(text, "volume", volumes_of(client));
}

std::string job_id(Client& client, const std::string& text) {
  return timed_id(text, "job", [&client] { return candidates_of(client.all_jobs()); });
}

std::vector<Candidate> ids_of(Client& client, const std::string& kind) {
  if (kind == "volumes") return volumes_of(client);
  return candidates_of(client.jobs().jobs);
}

}  // namespace isomesh::cli
