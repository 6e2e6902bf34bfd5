#include "libeditnerf/server/editor_server.h"

#include <httplib.h>
#include <sys/socket.h>
#include <torch/types.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/json_text.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/imaging/encoded_image.h"
#include "libeditnerf/pipeline/interactive_renderer.h"
#include "libeditnerf/server/base64.h"
#include "libeditnerf/server/connection_threads.h"
#include "libeditnerf/server/editor_tabs.h"
#include "libeditnerf/server/render_thread.h"
#include "libeditnerf/server/request_fields.h"
#include "libeditnerf/server/request_guard.h"
#include "libeditnerf/server/session_json.h"
#include "libeditnerf/server/tab_videos.h"

namespace editnerf {
namespace {

constexpr size_t kMaxBody = 1 << 20;
constexpr size_t kMaxOperations = 1000;
constexpr int64_t kMinWidth = 16, kMaxWidth = 1920;
constexpr int kPreviewQuality = 80, kPictureQuality = 95;
// Each may be a file that is open, of which systems often allow 1024.
constexpr size_t kMaxConnections = 512;
constexpr const char* kJson = "application/json";

void Answer(const Json& json, httplib::Response* response, int status = 200) {
  response->status = status;
  response->set_content(json.dump(-1, ' ', false, Json::error_handler_t::replace), kJson);
}

void AnswerError(const std::string& message, int status, httplib::Response* response) {
  Answer({{"error", message}}, response, status);
}

const char* StateName(VideoStatus::State state) {
  static constexpr const char* kNames[] = {"none", "running", "done", "cancelled", "failed"};
  return kNames[static_cast<int>(state)];
}

}  // namespace

struct EditorServer::Impl {
  Impl(Run run, const EditorServerOptions& with)
      : options(with),
        scene(std::make_shared<const EditableScene>(MakeEditableScene(run))),
        tabs(scene),
        renderer(std::move(run)),
        videos(thread, renderer) {}

  std::optional<std::string> Refuse(const httplib::Request& request) const;
  Json Picture(const Json& wish, EditorTab& tab, const std::string& name);
  void Edit(const httplib::Request& request, httplib::Response* response);
  EditFile TrailOf(const std::string& tab, double fps, int64_t width);
  void AddRoutes();
  void AddVideoRoutes();
  void AddMotionRoutes();
  void AddGuards();

  EditorServerOptions options;
  GuardOptions guard;
  std::shared_ptr<const EditableScene> scene;
  EditorTabs tabs;
  InteractiveRenderer renderer;
  RenderThread thread;
  TabVideos videos;
  httplib::Server http;
  int port = 0;
};

std::optional<std::string> EditorServer::Impl::Refuse(const httplib::Request& request) const {
  RequestHeaders headers;
  headers.token = request.has_header("X-Editor-Token") ? request.get_header_value("X-Editor-Token")
                                                       : request.get_param_value("token");
  headers.host = request.get_header_value("Host");
  headers.origin = request.get_header_value("Origin");
  const std::string why = WhyRefused(headers, guard);
  if (why.empty()) return std::nullopt;
  return why;
}

// Called without the tab's lock, which rendering would hold for too long: other requests of the tab only wait for the
// state to be copied.
Json EditorServer::Impl::Picture(const Json& wish, EditorTab& tab, const std::string& name) {
  PictureRequest request;
  request.width = JsonInteger(wish, "width", "request: picture");
  if (request.width < kMinWidth || request.width > kMaxWidth) {
    Throw<DataError>("request: picture: width: expected {} to {} pixels, found {}", kMinWidth, kMaxWidth,
                     request.width);
  }
  if (wish.contains("weights")) request.weights = JsonNumber(wish, "weights", "request: picture");
  request.preview = JsonFlag(wish, "preview", "request: picture");
  {
    const std::lock_guard<std::mutex> lock(tab.mutex);
    request.key_points = tab.session.state().key_points;
    request.row = tab.session.state().row;
    request.camera = tab.session.camera();
  }
  torch::Tensor picture;
  const Stopwatch clock;
  thread.Run(name, [&](const std::function<bool()>& stale) {
    picture = renderer.Render(request, request.preview ? std::function<bool()>() : stale);
  });
  if (!picture.defined()) return nullptr;
  const std::string bytes = EncodeJpeg(picture, request.preview ? kPreviewQuality : kPictureQuality);
  return {{"width", picture.size(1)},   {"height", picture.size(0)}, {"type", "image/jpeg"},
          {"preview", request.preview}, {"data", Base64(bytes)},     {"milliseconds", 1e3 * clock.Seconds()}};
}

void EditorServer::Impl::Edit(const httplib::Request& request, httplib::Response* response) {
  const Json body = ParseRequest(request.body);
  const std::string name = TabName(body);
  const std::shared_ptr<EditorTab> tab = tabs.Of(name);
  if (body.contains("operations")) {
    const Json& operations = JsonList(body, "operations", kMaxOperations);
    const std::lock_guard<std::mutex> lock(tab->mutex);
    for (size_t i = 0; i < operations.size(); ++i) {
      ApplyOperation(operations[i], fmt::format("request: operations[{}]", i), &tab->session);
    }
  }
  Json answer;
  answer["picture"] = body.contains("picture") ? Picture(body["picture"], *tab, name) : Json(nullptr);
  const std::lock_guard<std::mutex> lock(tab->mutex);
  answer["state"] = SessionToPageJson(tab->session);
  answer["fresh"] = std::exchange(tab->fresh, false);
  Answer(answer, response);
}

EditFile EditorServer::Impl::TrailOf(const std::string& name, double fps, int64_t width) {
  const std::shared_ptr<EditorTab> tab = tabs.Of(name);
  const std::lock_guard<std::mutex> lock(tab->mutex);
  const EditTrail& trail = tab->session.trail();
  int64_t height = 0;
  if (width != 0) {
    if (width < kMinWidth || width > kMaxWidth) {
      Throw<DataError>("request: width: expected {} to {} pixels, found {}", kMinWidth, kMaxWidth, width);
    }
    const Camera& camera = tab->session.camera();
    height = std::max<int64_t>(width * camera.height / camera.width, 1);
  }
  return trail.ToEditFile(scene->scene, fps, width, height);
}

void EditorServer::Impl::AddGuards() {
  guard.token = options.token;
  guard.hosts = options.allow_hosts;
  guard.loopback_only = options.host == "127.0.0.1" || options.host == "localhost" || options.host == "::1";
  if (!guard.loopback_only) guard.hosts.push_back(options.host);
  http.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
    response.set_header("Cache-Control", "no-store");
    response.set_header("Referrer-Policy", "no-referrer");
    response.set_header("X-Content-Type-Options", "nosniff");
    const auto why = Refuse(request);
    if (!why) return httplib::Server::HandlerResponse::Unhandled;
    AnswerError(*why, 403, &response);
    return httplib::Server::HandlerResponse::Handled;
  });
  http.set_error_handler([](const httplib::Request&, httplib::Response& response) {
    if (!response.body.empty()) return;
    const int status = response.status;
    AnswerError(status == 404   ? "there is nothing at this address"
                : status == 413 ? "the request is larger than 1 MiB"
                                : "the request cannot be answered",
                status, &response);
  });
  http.set_exception_handler([](const httplib::Request&, httplib::Response& response, std::exception_ptr error) {
    try {
      std::rethrow_exception(std::move(error));
    } catch (const DataError& mistake) {
      AnswerError(mistake.what(), 400, &response);
    } catch (const Json::exception& mistake) {  // past all checks: its text is about the program, not the request
      LogWarning("editor: {}", mistake.what());
      AnswerError("request: a value has a type that was not expected", 400, &response);
    } catch (const Interrupted&) {
      AnswerError("the editor is being stopped", 503, &response);
    } catch (const std::exception& failure) {
      LogWarning("editor: {}", failure.what());
      AnswerError(failure.what(), 500, &response);
    }
  });
}

void EditorServer::Impl::AddRoutes() {
  http.Get("/", [this](const httplib::Request&, httplib::Response& response) {
    const std::string nonce = RandomToken(), place = "{{nonce}}";
    std::string page = options.page;
    for (size_t at = page.find(place); at != std::string::npos; at = page.find(place, at)) {
      page.replace(at, place.size(), nonce);
    }
    response.set_header("Content-Security-Policy",
                        "default-src 'none'; script-src 'nonce-" + nonce + "'; style-src 'nonce-" + nonce +
                            "'; img-src blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
                            "frame-ancestors 'none'");
    response.set_content(page, "text/html; charset=utf-8");
  });
  http.Get("/api/scene", [this](const httplib::Request&, httplib::Response& response) {
    Answer(SceneToPageJson(*scene, options.title), &response);
  });
  http.Post("/api/edit",
            [this](const httplib::Request& request, httplib::Response& response) { Edit(request, &response); });
  http.Get("/api/trail", [this](const httplib::Request& request, httplib::Response& response) {
    const EditFile edit = TrailOf(request.get_param_value("tab"), Fps(request.get_param_value("fps")), 0);
    response.set_header("Content-Disposition", "attachment; filename=\"edit.json\"");
    response.set_content(WriteEditFile(edit), kJson);
  });
  AddVideoRoutes();
  AddMotionRoutes();
}

void EditorServer::Impl::AddVideoRoutes() {
  http.Post("/api/video", [this](const httplib::Request& request, httplib::Response& response) {
    const Json body = ParseRequest(request.body);
    const double fps = JsonNumber(body, "fps", "request");
    const std::string tab = TabName(body);
    const std::string why = videos.Start(tab, TrailOf(tab, fps, JsonInteger(body, "width", "request")));
    if (!why.empty()) return AnswerError(why, 409, &response);
    Answer({{"state", "running"}}, &response);
  });
  http.Get("/api/video", [this](const httplib::Request& request, httplib::Response& response) {
    const auto video = videos.Of(request.get_param_value("tab"));
    const VideoStatus status = video ? video->Status() : VideoStatus();
    Answer({{"state", StateName(status.state)},
            {"done", status.done},
            {"total", status.total},
            {"message", status.message}},
           &response);
  });
  http.Delete("/api/video", [this](const httplib::Request& request, httplib::Response& response) {
    const auto video = videos.Of(request.get_param_value("tab"));
    if (video) video->Cancel();
    Answer({{"state", StateName(video ? video->Status().state : VideoStatus::State::kNone)}}, &response);
  });
  http.Get("/api/video/file", [this](const httplib::Request& request, httplib::Response& response) {
    const auto video = videos.Of(request.get_param_value("tab"));
    if (!video || video->Status().state != VideoStatus::State::kDone) {
      return AnswerError("no video is ready", 409, &response);
    }
    if (!std::filesystem::exists(video->path())) {
      return AnswerError("the video was deleted from the temporary folder; render it again", 410, &response);
    }
    response.set_header("Content-Disposition", "attachment; filename=\"edited.mp4\"");
    response.set_content(ReadFile(video->path()), "video/mp4");
  });
}

void EditorServer::Impl::AddMotionRoutes() {
  http.Post("/api/motion/video", [this](const httplib::Request& request, httplib::Response& response) {
    const auto motion = tabs.MotionOf(request.get_param_value("tab"));
    motion->Receive(WholeNumberIn(request.get_param_value("offset"), "offset"),
                    WholeNumberIn(request.get_param_value("size"), "size"), request.body);
    if (WholeNumberIn(request.get_param_value("last"), "last") == 0) return Answer(Json::object(), &response);
    const torch::Tensor frame = motion->FirstFrame();
    Answer(
        {{"width", frame.size(1)}, {"height", frame.size(0)}, {"picture", Base64(EncodeJpeg(frame, kPictureQuality))}},
        &response);
  });
  http.Post("/api/motion", [this](const httplib::Request& request, httplib::Response& response) {
    const Json body = ParseRequest(request.body);
    const std::string name = TabName(body);
    TransferOptions transfer;
    transfer.key_point = JsonInteger(body, "key_point", "request");
    transfer.reversed = JsonFlag(body, "reversed", "request");
    if (body.contains("axes")) transfer.axes = JsonInteger(body, "axes", "request");
    if (transfer.axes != 1 && transfer.axes != 2) {
      Throw<DataError>("request: axes: expected 1 or 2, found {}", transfer.axes);
    }
    if (body.contains("pairs")) transfer.pairs = FramePairsOf(body);
    const std::shared_ptr<EditorTab> tab = tabs.Of(name);
    {
      const std::lock_guard<std::mutex> lock(tab->mutex);
      transfer.view = tab->session.camera();
    }
    tabs.MotionOf(name)->Start({JsonNumber(body, "u", "request"), JsonNumber(body, "v", "request")}, transfer);
    Answer({{"state", "running"}}, &response);
  });
  http.Get("/api/motion", [this](const httplib::Request& request, httplib::Response& response) {
    Answer(MotionToPageJson(tabs.MotionOf(request.get_param_value("tab"))->Status()), &response);
  });
}

EditorServer::EditorServer(Run run, const EditorServerOptions& options)
    : impl_(std::make_unique<Impl>(std::move(run), options)) {
  if (options.token.empty()) Throw<ConfigError>("editor: expected a token, found none");
  httplib::Server& http = impl_->http;
  http.new_task_queue = [] { return new ConnectionThreads(kMaxConnections); };
  http.set_payload_max_length(kMaxBody);
  http.set_keep_alive_max_count(1'000'000);
  http.set_tcp_nodelay(true);
  // The default would share a port that another program listens on, and get half of its requests.
  socket_t listening = INVALID_SOCKET;
  http.set_socket_options([&listening](socket_t socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    listening = socket;
  });
  impl_->AddGuards();
  impl_->AddRoutes();
  if (options.port != 0 && http.bind_to_port(options.host.c_str(), options.port)) {
    impl_->port = options.port;
  } else if (options.port == 0 || options.any_port_if_taken) {
    impl_->port = http.bind_to_any_port(options.host.c_str());
  }
  if (impl_->port <= 0) {
    Throw<ConfigError>("{}:{}: cannot listen here; is the port in use, or the address not this machine's?",
                       options.host, options.port);
  }
  // The library lets five connections wait to be accepted; one more, as two tabs open them, begins again a second
  // later.
  ::listen(listening, SOMAXCONN);
  http.set_socket_options([](socket_t) {});
}

EditorServer::~EditorServer() = default;

int EditorServer::port() const { return impl_->port; }

std::string EditorServer::Url() const {
  const std::string& host = impl_->options.host;
  const bool everywhere = host == "0.0.0.0" || host == "::";
  const std::string name = everywhere ? "localhost" : host.find(':') != std::string::npos ? "[" + host + "]" : host;
  return fmt::format("http://{}:{}/?token={}", name, impl_->port, impl_->options.token);
}

void EditorServer::Serve(const std::function<bool()>& stop) {
  std::thread listener([this] { impl_->http.listen_after_bind(); });
  while (!stop()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  if (const auto video = impl_->videos.Of("")) video->Cancel();
  // Told to stop before it runs, the server would not hear it.
  while (!impl_->http.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  impl_->http.stop();
  listener.join();
}

}  // namespace editnerf
