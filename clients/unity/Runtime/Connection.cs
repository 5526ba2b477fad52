using System;
using Troupe.Native;

namespace Troupe
{
    /// <summary>
    /// A connection to a server. Dispose of it when you are done; its packs and crowds stay open until they are disposed
    /// of. Calls wait for the server, so connect and open outside of the frame loop.
    /// </summary>
    public sealed unsafe class Connection : IDisposable
    {
        private TroupeConnection handle;

        /// <summary>Connects to a server such as http://127.0.0.1:8080. https:// uses TLS.</summary>
        public Connection(string url, ConnectOptions options = null)
        {
            var library = Api.troupe_abi_version();
            if (library != Api.TROUPE_ABI_VERSION)
            {
                throw new NotSupportedException(string.Format(
                    "the library has interface {0}, but this code needs {1}: take both from one release",
                    library, Api.TROUPE_ABI_VERSION));
            }
            options = options ?? new ConnectOptions();
            using (var texts = new Texts())
            {
                var native = new TroupeConnectOptions
                {
                    size = (uint)sizeof(TroupeConnectOptions),
                    connect_timeout_ms = Milliseconds(options.ConnectTimeout),
                    request_timeout_ms = Milliseconds(options.RequestTimeout),
                    url = texts.Of(url),
                    key = texts.Of(options.Key),
                    ca_file = texts.Of(options.CaFile),
                    certificate_file = texts.Of(options.CertificateFile),
                    key_file = texts.Of(options.KeyFile),
                };
                TroupeConnection opened;
                TroupeException.Check(Api.troupe_connect(&native, &opened));
                handle = opened;
            }
        }

        /// <summary>Names of the server's packs.</summary>
        public string[] Packs()
        {
            var packs = new TroupePacks { size = (uint)sizeof(TroupePacks) };
            TroupeException.Check(Api.troupe_packs(handle, &packs));
            return Texts.Read(packs.names, packs.count);
        }

        /// <summary>
        /// Opens a pack: the server's default without a name, on one of its bodies, or on a skeleton of your own that the
        /// server has.
        /// </summary>
        public Pack OpenPack(string name = null, string body = null, string skeleton = null)
        {
            using (var texts = new Texts())
            {
                var options = new TroupePackOptions
                {
                    size = (uint)sizeof(TroupePackOptions),
                    name = texts.Of(name),
                    body = texts.Of(body),
                    skeleton = texts.Of(skeleton),
                };
                TroupePack opened;
                TroupeException.Check(Api.troupe_pack_open(handle, &options, &opened));
                return new Pack(opened);
            }
        }

        /// <summary>Closes the connection. A second call does nothing.</summary>
        public void Dispose()
        {
            if (handle.id == 0) return;
            Api.troupe_connection_close(handle);
            handle = default(TroupeConnection);
        }

        /// <summary>A time for C, of which zero is the default.</summary>
        internal static uint Milliseconds(TimeSpan? time)
        {
            if (time == null) return 0;
            var ms = Math.Ceiling(time.Value.TotalMilliseconds);
            return (uint)Math.Max(1, Math.Min(ms, uint.MaxValue - 1));
        }
    }
}
