import jax, pytest, time
from detpg import ALGORITHMS, ENVIRONMENTS
from detpg.testing import check_algorithm, PROBES, check_probe
from detpg.policies import NetworkPolicy
from detpg.critics import EnsembleActionValue
SMALL=dict(memory=64,batch=4,warm_up=3)
@pytest.mark.parametrize("name",["ddpg","td3"])
def test_conf(name):
    b=ENVIRONMENTS["bandit"](3)
    check_algorithm(ALGORITHMS[name].create(b.spec,**SMALL,policy=NetworkPolicy(b.spec.observation_size,3,(8,)),action_value=EnsembleActionValue(b.spec.observation_size,3,(8,),size=1 if name=="ddpg" else 2)),b,jax.random.key(1))
@pytest.mark.parametrize("name",["ddpg","td3"])
@pytest.mark.parametrize("probe",PROBES)
def test_probe(name,probe):
    p=PROBES[probe]; d=p.spec.observation_size
    kw=dict(smoothing=0.0) if name=="td3" else {}
    a=ALGORITHMS[name].create(p.spec,gamma=0.5,memory=5000,batch=64,warm_up=100,alpha_theta=1e-4,alpha_w=5e-4,sigma=0.5,tau=0.02,policy=NetworkPolicy(d,1,(32,32)),action_value=EnsembleActionValue(d,1,(32,32),size=1 if name=="ddpg" else 2),**kw)
    check_probe(a,p,steps=20000,seeds=2)
