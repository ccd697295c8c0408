#include "tests/api/daemon.h"

#include <stdexcept>

#include "proto/json.h"

namespace isomesh::test {
namespace {

std::vector<std::string> command_line(const std::filesystem::path& data, const std::string& listen,
                                      const std::vector<std::string>& arguments,
                                      const std::vector<std::string>& prefix = {}) {
  return with(with(prefix, {ISOMESHD, "--listen", listen, "--data", data}), arguments);
}

std::string numbers(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  return std::to_string(x) + ',' + std::to_string(y) + ',' + std::to_string(z);
}

}  // namespace

Daemon::Daemon(const std::vector<std::string>& arguments)
    : data_(folder_ / "data"),
      process_(command_line(data_, "127.0.0.1:0", arguments)),
      url_(url_of(process_)) {}

Daemon::Daemon(const std::filesystem::path& data, const std::string& listen,
               const std::vector<std::string>& arguments, const std::vector<std::string>& prefix)
    : data_(data),
      process_(command_line(data, listen, arguments, prefix)),
      url_(url_of(process_)) {}

int Daemon::stop() {
  terminate();
  return wait();
}

Answer Daemon::send(const std::string& method, const std::string& target, const std::string& body,
                    const Headers& headers) const {
  return answer_to(url_, request(method, target, body, headers));
}

Finished Daemon::command(const std::vector<std::string>& arguments) const {
  return run(with({ISOMESH, "--server", url_}, arguments));
}

Finished refused_start(const std::filesystem::path& data,
                       const std::vector<std::string>& arguments) {
  return run(command_line(data, "127.0.0.1:0", arguments));
}

RawUpload raw_upload(const SampleVolume<std::uint8_t>& volume) {
  const std::string dims = numbers(volume.dims.x, volume.dims.y, volume.dims.z);
  return {bytes_of(volume.samples),
          "dims=" + dims + "&type=uint8",
          {"--dims", dims, "--type", "uint8"}};
}

RawUpload sphere_upload() {
  const Field field = scaled(sphere({10.2, 9.7, 9.1}, 6.4), 12, 100);
  return raw_upload(sample<std::uint8_t>(field, {21, 20, 19}));
}

RawUpload rough_upload() { return raw_upload(noise<std::uint8_t>({0, 100}, {48, 48, 48}, 11)); }

std::string slow_smoothing(int passes) {
  return R"("smoothing": "optimize", "draco": {"speed": 10}, "passes": )" + std::to_string(passes);
}

RawUpload long_upload() { return raw_upload(noise<std::uint8_t>({0, 100}, {96, 96, 96}, 11)); }

Volume upload(const Daemon& daemon, const RawUpload& raw) {
  const Answer answer = daemon.send("POST", "/v1/volumes?" + raw.query, raw.bytes);
  if (answer.status != 201 && answer.status != 200) throw std::runtime_error(answer.body);
  return volume_from_json(answer.body);
}

std::string job_body(const std::string& volume, double iso, const std::string& members) {
  return "{\"volume\": \"" + volume + "\", \"iso\": " + std::to_string(iso) +
         (members.empty() ? "" : ", " + members) + "}";
}

Job submit(const Daemon& daemon, const Volume& volume, double iso, const std::string& members) {
  const Answer answer = daemon.send("POST", "/v1/jobs", job_body(volume.id, iso, members));
  if (answer.status != 202) throw std::runtime_error(answer.body);
  return job_from_json(answer.body);
}

Job finished_job(const Daemon& daemon, const std::string& members) {
  const Job job = submit(daemon, upload(daemon, sphere_upload()), 100, members);
  const Job ended = daemon.client().wait(job.id);
  if (ended.state != JobState::kSucceeded) throw std::runtime_error(to_json(ended));
  return ended;
}

Job long_job(const Daemon& daemon, double iso) {
  const std::string id =
      submit(daemon, upload(daemon, rough_upload()), iso, slow_smoothing(1000)).id;
  Job seen;
  const bool has_begun = eventually([&] {
    seen = daemon.client().job(id);
    return seen.stage == Stage::kSmooth || is_final(seen.state);
  });
  if (!has_begun || seen.state != JobState::kRunning) throw std::runtime_error(to_json(seen));
  return seen;
}

std::set<pid_t> job_processes(const Daemon& daemon) {
  std::set<pid_t> found = children_of(daemon.pid());
  std::erase_if(found, [](pid_t process) { return program_of(process) != kJobProgram; });
  return found;
}

HeldWorker::HeldWorker(const Daemon& daemon) {
  finished_job(daemon);
  const std::set<pid_t> processes = job_processes(daemon);
  if (processes.size() != 1) throw std::runtime_error("there is not one process for jobs");
  process_ = *processes.begin();
  ::kill(process_, SIGSTOP);
}

}  // namespace isomesh::test
